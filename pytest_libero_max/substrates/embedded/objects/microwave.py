"""The microwave oven with its door."""

from __future__ import annotations

from pytest_libero_max.substrates.embedded.labels import Label
from pytest_libero_max.substrates.embedded.meshes import Mesh, join, panel
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Grip,
    Joint,
    JointState,
    Link,
    Site,
    Skin,
    slab,
    slab_mesh,
)
from pytest_libero_max.worlds.contract import Image

_SHELL, _CREAM, _DARK, _STEEL = (0.66, 0.67, 0.69), (0.88, 0.86, 0.80), (0.10, 0.10, 0.11), (0.82, 0.83, 0.85)
_FEET = 0.020


def microwave() -> Category:
    """Return a table-top oven, 0.35 m wide, whose door opens towards -y and to the left.

    It stands on feet of 2 cm: LIBERO's oven hovers that high over the table.
    """
    left, right, front, back, top = -0.1725, 0.1725, -0.0865, 0.1110, 0.1885
    side, floor, panel_left = 0.0075, 0.010, 0.0635
    case = (
        slab((left, front, 0.0), (left + side, back, top)),
        slab((panel_left, front, 0.0), (right, back, top)),
        slab((left + side, back - 0.010, 0.0), (panel_left, back, top)),
        slab((left + side, front, 0.0), (panel_left, back - 0.010, floor)),
        slab((left + side, front, top - 0.0085), (panel_left, back - 0.010, top)),
        slab((0.0875, front - 0.024, 0.0), (right, front, 0.187)),
    )
    feet = tuple(
        slab((x - 0.012, y - 0.012, -_FEET), (x + 0.012, y + 0.012, 0.0))
        for x in (left + 0.03, right - 0.03)
        for y in (front + 0.03, back - 0.03)
    )
    inside = join(
        *_lining((left + side, front, floor), (panel_left, back - 0.010, top - 0.0085)),
    )
    controls = panel(
        [
            (0.0905, front - 0.0244, 0.004),
            (right - 0.003, front - 0.0244, 0.004),
            (right - 0.003, front - 0.0244, 0.183),
            (0.0905, front - 0.0244, 0.183),
        ]
    )
    main = Link(
        "main",
        3.0,
        (*case, *feet),
        (
            Skin(slab_mesh(case, 0.2), _SHELL, shine=0.5),
            Skin(inside, _CREAM, shine=0.2),
            Skin(controls, texture="controls", shine=0.4),
            Skin(slab_mesh(feet, 0.2), _DARK, shine=0.1),
        ),
        (
            Site("top_side", (0.0, 0.01, 0.2), (0.12, 0.0835, 0.005)),
            Site("heating_region", (0.0, 0.01, 0.096), (0.12, 0.0835, 0.08)),
        ),
        links=(_door(),),
    )
    return Category(
        "microwave",
        main,
        fixture=True,
        spread_margin=0.015,
        textures={"controls": _controls, "window": _window},
        states={
            "open": JointState(high=-1.3, start=(-2.094, -1.3)),
            "close": JointState(low=-0.005, every=True),
        },
        lift=0.015,
    )


def _door() -> Link:
    """Return a pane in a frame, hinged at its left edge, with an upright bar to pull at."""
    width, low, high = 0.2585, -0.0925, 0.0925
    pane = slab((0.0, -0.025, low), (width, -0.002, high))
    bar = slab((0.2300, -0.0640, -0.065), (0.2450, -0.0500, 0.065))
    posts = tuple(slab((0.2320, -0.0500, z - 0.006), (0.2430, -0.025, z + 0.006)) for z in (-0.055, 0.055))
    window = panel(
        [
            (0.002, -0.0254, low + 0.002),
            (width - 0.002, -0.0254, low + 0.002),
            (width - 0.002, -0.0254, high - 0.002),
            (0.002, -0.0254, high - 0.002),
        ]
    )
    back = panel(
        [
            (width - 0.004, -0.0016, low + 0.004),
            (0.004, -0.0016, low + 0.004),
            (0.004, -0.0016, high - 0.004),
            (width - 0.004, -0.0016, high - 0.004),
        ]
    )
    return Link(
        "microdoorroot",
        0.26,
        (pane, bar, *posts),
        (
            Skin(slab_mesh((pane,), 0.2), (0.30, 0.31, 0.33), shine=0.4),
            Skin(join(window, back), texture="window", shine=0.7),
            Skin(slab_mesh((bar, *posts), 0.2), _STEEL, shine=0.8),
        ),
        joint=Joint("microjoint", "hinge", (0.0, 0.0, 1.0), (-2.094, 0.0), 0.5),
        pos=(-0.1725, -0.088, 0.096),
        grips=(Grip("door_handle", (0.2375, -0.0570, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), 0.015),),
    )


def _lining(low: tuple[float, float, float], high: tuple[float, float, float]) -> list[Mesh]:
    """Return the inside of a box that is open towards -y."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    e = 0.0004
    return [
        panel([(x0, y0, z0 + e), (x1, y0, z0 + e), (x1, y1, z0 + e), (x0, y1, z0 + e)]),
        panel([(x0, y1, z1 - e), (x1, y1, z1 - e), (x1, y0, z1 - e), (x0, y0, z1 - e)]),
        panel([(x0, y1 - e, z0), (x1, y1 - e, z0), (x1, y1 - e, z1), (x0, y1 - e, z1)]),
        panel([(x0 + e, y0, z0), (x0 + e, y1, z0), (x0 + e, y1, z1), (x0 + e, y0, z1)]),
        panel([(x1 - e, y1, z0), (x1 - e, y0, z0), (x1 - e, y0, z1), (x1 - e, y1, z1)]),
    ]


def _controls() -> Image:
    label = Label((44, 45, 48), 96, 192)
    label.block(0.12, 0.06, 0.88, 0.2, (10, 30, 20)).word("COOK", 0.5, 0.13, 0.6, 0.09, (90, 240, 140))
    for row in range(4):
        for column in range(3):
            x, y = 0.24 + 0.26 * column, 0.3 + 0.11 * row
            label.block(x - 0.1, y - 0.035, x + 0.1, y + 0.035, (196, 198, 202))
    label.block(0.12, 0.78, 0.46, 0.9, (190, 44, 40)).block(0.54, 0.78, 0.88, 0.9, (50, 150, 70))
    return label.image


def _window() -> Image:
    """Dark glass with a grid of holes behind it and two streaks of reflected light, in a steel frame."""
    label = Label((150, 152, 156), 192, 128).block(0.03, 0.05, 0.97, 0.95, (52, 54, 58))
    label.block(0.08, 0.14, 0.82, 0.86, (14, 16, 18))
    for row in range(9):
        for column in range(16):
            label.disc(0.12 + 0.044 * column, 0.2 + 0.075 * row, 0.006, (44, 48, 52))
    label.polygon([(0.2, 0.86), (0.42, 0.14), (0.5, 0.14), (0.28, 0.86)], (36, 42, 48))
    return label.image
