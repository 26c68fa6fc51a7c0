"""The cabinets, the flat stove and the basket: what other things are put on or into."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import MappingProxyType

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.meshes import box, join, panel, revolve
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Colour,
    Grip,
    Joint,
    JointState,
    Link,
    Site,
    Skin,
    Solid,
    slab,
    slab_mesh,
)
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Image

_HALF = math.sqrt(0.5)
_DRAWER_STATES = MappingProxyType(
    {
        "open": JointState(high=-0.14, start=(-0.16, -0.14)),
        # A drawer that is merely flush is not closed: LIBERO wants it pushed in a little further.
        "close": JointState(low=0.0, every=True),
    }
)
_KNOB_STATES = MappingProxyType(
    {
        "turnon": JointState(low=0.5, closed=True, start=(0.5, 2.1)),
        "turnoff": JointState(high=0.0, every=True),
    }
)


def wooden_cabinet() -> Category:
    """Return a brown cabinet, 0.25 m wide and 0.22 m high; its three drawers slide out along -y."""
    return _cabinet(
        "wooden_cabinet",
        lambda: textures.wood(128, (112, 66, 34), (158, 100, 56), seed=5),
        lambda: _framed(textures.wood(128, (128, 78, 42), (176, 116, 66), seed=9)),
        (0.16, 0.15, 0.15),
    )


def white_cabinet() -> Category:
    """Return the same cabinet painted white, with steel handles."""
    return _cabinet(
        "white_cabinet",
        lambda: textures.blend(textures.noise(128, 128, 87, 8), (222, 222, 218), (242, 242, 238)),
        lambda: _framed(textures.blend(textures.noise(128, 128, 89, 8), (232, 232, 228), (248, 248, 245))),
        (0.62, 0.63, 0.66),
    )


def _cabinet(name: str, wood: Callable[[], Image], front: Callable[[], Image], steel: Colour) -> Category:
    """Return a cabinet, its two pictures and the colour of its handles."""
    left, right, near, back, bottom, top = -0.1234, 0.1312, -0.086, 0.1117, 0.0046, 0.223
    wall = 0.005
    case = (
        slab((left, near, bottom), (left + wall, back, top)),
        slab((right - wall, near, bottom), (right, back, top)),
        slab((left + wall, back - wall, bottom), (right - wall, back, top)),
        slab((left + wall, near, bottom), (right - wall, back - wall, bottom + wall)),
        slab((left + wall, near, top - wall), (right - wall, back - wall, top)),
    )
    base = Link(
        "base",
        0.176239,
        case,
        (Skin(slab_mesh(case, 0.16), texture="wood", shine=0.1),),
        (Site("top_side", (0.00354, 0.01567, 0.22152), (0.12534, 0.09438, 0.00147)),),
        links=tuple(
            _drawer(drawer, middle, steel)
            for drawer, middle in (("top", 0.18563), ("middle", 0.1169), ("bottom", 0.04701))
        ),
    )
    return Category(
        name,
        Link("main", 0.0, links=(base,)),
        fixture=True,
        spread_margin=0.045,
        textures={"wood": wood, "front": front},
        states=_DRAWER_STATES,
    )


def _drawer(name: str, middle: float, steel: Colour) -> Link:
    left, right, front, back = -0.1164, 0.1242, -0.0905, 0.0925
    low, high, wall, sheet = middle - 0.0328, middle + 0.0285, 0.004, 0.0035
    boards = (
        slab((left, front, low), (right, front + 0.007, high)),
        slab((left, back - wall, low), (right, back, high)),
        slab((left, front + 0.007, low), (left + wall, back - wall, high)),
        slab((right - wall, front + 0.007, low), (right, back - wall, high)),
        slab((left + wall, front + 0.007, low), (right - wall, back - wall, low + sheet)),
    )
    centre = (left + right) / 2
    # A bar on two posts, deep enough for a finger behind it.
    bar = slab((centre - 0.036, -0.1093, middle - 0.005), (centre + 0.036, -0.1023, middle + 0.005))
    posts = tuple(
        slab((x - 0.004, -0.1025, middle - 0.004), (x + 0.004, front, middle + 0.004))
        for x in (centre - 0.030, centre + 0.030)
    )
    face = panel(
        [
            (left, front - 0.0004, low),
            (right, front - 0.0004, low),
            (right, front - 0.0004, high),
            (left, front - 0.0004, high),
        ]
    )
    skins = (
        Skin(slab_mesh(boards, 0.16), (0.92, 0.88, 0.8), "wood", 0.1),
        Skin(face, texture="front", shine=0.1),
        Skin(slab_mesh((bar, *posts), 0.16), steel, None, 0.6),
    )
    # LIBERO's quaternion: the region's x axis points down, its z axis along the cabinet's width.
    region = Site(
        f"{name}_region", (0.00328, 0.01128, middle), (0.02993, 0.07561, 0.10224), (_HALF, 0.0, _HALF, 0.0)
    )
    slide = Joint(f"{name}_level", "slide", (0.0, 1.0, 0.0), (-0.16, 0.01), 50.0)
    grip = Grip(f"{name}_handle", (centre, -0.1058, middle), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), 0.010)
    return Link(f"cabinet_{name}", 3.0, (*boards, bar, *posts), skins, (region,), slide, grips=(grip,))


def _framed(picture: Image) -> Image:
    """Return the front of a drawer: a picture with two grooves around it."""
    for inset, tone in ((0, 0.55), (10, 0.8)):
        frame = slice(inset, 128 - inset)
        for edge in (inset, inset + 1, 126 - inset, 127 - inset):
            picture[edge, frame] = (picture[edge, frame] * tone).astype(picture.dtype)
            picture[frame, edge] = (picture[frame, edge] * tone).astype(picture.dtype)
    return picture


def flat_stove() -> Category:
    """Return a table-top stove: a dark plate with one burner, and a knob at its left end."""
    plate = Solid((0.0, 0.0, 0.0), (0.095, 0.095, 0.02))
    casing = box((0.095, 0.095, 0.0195), 0.003, atlas=False)
    coil = revolve([(0.074, 0.0195), (0.074, 0.0208), (0.0, 0.0208)], 28)
    burner = Link(
        "burner",
        1.4801,
        (plate,),
        (Skin(casing, (0.13, 0.13, 0.14), None, 0.6), Skin(coil, texture="coil", shine=0.3)),
        (
            Site("cook_region", (0.0, 0.0, 0.0), (0.075, 0.075, 0.0025)),
            Site("burner", (0.0, 0.0, 0.022), (0.0625, 0.0625, 0.0005)),
        ),
        pos=(0.15, 0.0, 0.0),
    )
    console = Solid((0.001, 0.0, 0.0), (0.0535, 0.065, 0.014))
    grip = Solid((0.0, 0.0, 0.0375), (0.007, 0.024, 0.0125))
    disc = Solid((0.0, 0.0, 0.0205), (0.021, 0.021, 0.0055))
    knob = join(
        revolve([(0.026, 0.0142), (0.026, 0.0245), (0.023, 0.0262), (0.0, 0.0262)], 20),
        box((0.007, 0.024, 0.0125), 0.002, atlas=False).moved(grip.pos),
    )
    mark = panel(
        [(-0.0015, 0.004, 0.0503), (0.0015, 0.004, 0.0503), (0.0015, 0.021, 0.0503), (-0.0015, 0.021, 0.0503)]
    )
    button = Link(
        "button",
        3.0,
        (disc, grip),
        (Skin(knob, (0.25, 0.25, 0.27), None, 0.5), Skin(mark, (0.92, 0.2, 0.15))),
        joint=Joint("button", "hinge", (0.0, 0.0, 1.0), (-0.005, 2.1), 1.0),
        grips=(Grip("knob", grip.pos, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.014),),
    )
    panel_skin = Skin(
        box((0.0535, 0.065, 0.014), 0.003, atlas=False).moved(console.pos), (0.62, 0.63, 0.65), None, 0.6
    )
    base = Link("base", 0.0, (console,), (panel_skin,), links=(burner, button))
    return Category(
        "flat_stove",
        Link("main", 0.0, links=(base,)),
        fixture=True,
        spread_margin=0.045,
        textures={"coil": _coil},
        states=_KNOB_STATES,
    )


def _coil() -> Image:
    """Return the burner seen along the profile of its disc: turns of a heating coil on black."""
    import numpy as np

    v = np.arange(128) / 128
    rows = np.where((v * 7) % 1 < 0.55, 1.0, 0.0)
    pattern = np.tile(rows[:, None], (1, 32))
    return textures.blend(pattern, (24, 24, 26), (92, 84, 80))


def basket() -> Category:
    """Return an open wicker basket, 0.17 m wide and 0.14 m high, its walls leaning outwards."""
    bottom, top = 0.0046, 0.1457
    low, high = (0.0700, 0.0765), (0.0787, 0.0848)
    wall, floor = 0.006, 0.010
    rise = top - bottom - 0.0016
    solids = [Solid((0.0, 0.0, bottom + floor / 2), (low[0], low[1], floor / 2))]
    skins = [box((low[0], low[1], floor / 2), atlas=False, tile=0.1).moved((0.0, 0.0, bottom + floor / 2))]
    for axis in (0, 1):
        lean = math.atan2(high[axis] - low[axis], rise)
        length = rise / math.cos(lean)
        across = (low[1 - axis] + high[1 - axis]) / 2
        for sign in (1.0, -1.0):
            distance = (low[axis] + high[axis]) / 2 - wall / 2 * math.cos(lean)
            turn_axis = (0.0, sign, 0.0) if axis == 0 else (-sign, 0.0, 0.0)
            turn = rotations.about(turn_axis, lean)
            half = (wall / 2, across, length / 2) if axis == 0 else (across, wall / 2, length / 2)
            height = bottom + rise / 2 + 0.0008  # so that only the floor of the basket touches the ground
            centre = (sign * distance, 0.0, height) if axis == 0 else (0.0, sign * distance, height)
            solids.append(Solid(centre, half, turn))
            mesh = box(half, atlas=False, tile=0.1).moved(centre, turn=rotations.matrix(turn))
            skins.append(mesh)
    rim = [
        box((0.006, high[1] + 0.002, 0.006), 0.0015, atlas=False).moved(
            (s * (high[0] - 0.003), 0.0, top - 0.0055)
        )
        for s in (1.0, -1.0)
    ] + [
        box((high[0] + 0.002, 0.006, 0.006), 0.0015, atlas=False).moved(
            (0.0, s * (high[1] - 0.003), top - 0.0055)
        )
        for s in (1.0, -1.0)
    ]
    site = Site("contain_region", (0.0, 0.0, 0.07185), (0.06108, 0.06108, 0.06949), (0.0, 0.0, 0.0, 1.0))
    main = Link(
        "main",
        0.136107,
        solids,
        (Skin(join(*skins), texture="wicker", shine=0.05), Skin(join(*rim), (0.52, 0.33, 0.16), None, 0.1)),
        (site,),
    )
    return Category(
        "basket",
        main,
        upright=(_HALF, 0.0, 0.0, _HALF),
        origin_height=-bottom,
        textures={"wicker": textures.wicker},
    )
