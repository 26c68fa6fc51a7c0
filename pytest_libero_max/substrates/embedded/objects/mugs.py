"""Three mugs: wide cups that are pinched at the rim or held by the handle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.meshes import Mesh, revolve, tube
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Colour,
    Grip,
    Link,
    Skin,
    Solid,
    slab,
    wall_ring,
)
from pytest_libero_max.worlds.contract import Image

_WALL = 0.004
_FLOOR = 0.009
# The foot is narrower than the cup, so that it fits the well of a plate.
_CHAMFER = 0.008
_HANDLE_WIDTH = 0.012
_HANDLE_DEPTH = 0.008
# LIBERO turns its mugs by a quarter, the other way round than its bowls.
_UPRIGHT = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


@dataclass(frozen=True)
class _Shape:
    """Sizes of a mug whose handle points along y, m.

    The cup's axis is at y = ``middle``; its wall has the outer radius ``foot`` at the height ``bottom`` and
    ``rim`` at ``top``; the handle reaches to y = ``end``.
    """

    middle: float
    rim: float
    foot: float
    bottom: float
    top: float
    end: float

    @property
    def side(self) -> float:
        """1 if the handle points along +y, else -1."""
        return math.copysign(1.0, self.end - self.middle)

    def height(self, share: float) -> float:
        """Height at a share of the way from the bottom (0) to the top (1), m."""
        return self.bottom + (self.top - self.bottom) * share

    def wall(self, share: float) -> float:
        """Outside of the wall under the handle, as y, at the same share of the height, m."""
        return self.middle + self.side * (self.foot + (self.rim - self.foot) * share)


def porcelain_mug() -> Category:
    """Return a plain white mug, 96 mm wide and 106 mm high, its handle along +y."""
    # Its lowest point is its origin, as LIBERO draws it; LIBERO's collision shape ends 2.4 mm above that, and
    # ours would stand on our plate with its origin under the plate's, where On does not hold.
    shape = _Shape(-0.0121, 0.0480, 0.0440, 0.0, 0.1085, 0.0647)
    return _mug("porcelain_mug", shape, 0.016463, _porcelain, (0.95, 0.95, 0.93), (0.93, 0.93, 0.92))


def red_coffee_mug() -> Category:
    """Return a tall red mug, white inside, 93 mm wide and 133 mm high, its handle along -y."""
    shape = _Shape(0.0141, 0.0466, 0.0430, -0.0018, 0.1308, -0.0622)
    return _mug("red_coffee_mug", shape, 0.029353, _red, (0.74, 0.07, 0.07), (0.95, 0.93, 0.90))


def white_yellow_mug() -> Category:
    """Return a white mug, yellow below and inside, 106 mm wide and 103 mm high, its handle along -y."""
    shape = _Shape(0.0182, 0.0530, 0.0470, -0.0001, 0.1031, -0.0685)
    return _mug("white_yellow_mug", shape, 0.030912, _white_yellow, (0.95, 0.72, 0.10), (0.96, 0.78, 0.20))


def _mug(
    name: str, shape: _Shape, mass: float, glaze: Callable[[], Image], handle: Colour, inside: Colour
) -> Category:
    low, high, rim, foot = shape.bottom, shape.top, shape.rim, shape.foot
    outer = revolve(
        [
            (0.0, low + 0.002),
            (foot - 0.013, low + 0.002),
            (foot - 0.012, low),
            (foot - 0.008, low),
            (foot, low + _CHAMFER),
            (rim, high - 0.002),
            (rim - 0.001, high),
            (rim - _WALL + 0.001, high),
        ],
        28,
        crease_deg=50,
    )
    inner = revolve(
        [
            (rim - _WALL + 0.001, high),
            (rim - _WALL, high - 0.002),
            (foot - _WALL, low + _FLOOR + 0.004),
            (foot - _WALL - 0.004, low + _FLOOR),
            (0.0, low + _FLOOR),
        ],
        24,
        crease_deg=50,
    )
    centre = (0.0, shape.middle, 0.0)
    skins = (
        Skin(outer.moved(centre), texture="glaze", shine=0.6),
        Skin(inner.moved(centre), inside, shine=0.4),
        Skin(_ear(shape), handle, shine=0.6),
    )
    return Category(
        name,
        Link("main", mass, _solids(shape), skins, grips=_grips(shape)),
        upright=_UPRIGHT,
        origin_height=-low,
        textures={"glaze": glaze},
    )


def _solids(shape: _Shape) -> list[Solid]:
    """Return a ring of slabs, a floor that alone touches the table, and a handle of three bars."""
    low, half = shape.bottom, 0.62 * shape.foot
    y, far = shape.middle, shape.end - shape.side * _HANDLE_DEPTH
    solids = [slab((-half, y - half, low), (half, y + half, low + _FLOOR))]
    ring = wall_ring(12, (shape.foot, low + _CHAMFER), (shape.rim, shape.top), _WALL)
    solids += [Solid((s.pos[0], s.pos[1] + y, s.pos[2]), s.half, s.quat) for s in ring]
    width = _HANDLE_WIDTH / 2
    for share, start in ((0.26, shape.wall(0.26)), (0.82, shape.wall(0.82))):
        z = shape.height(share)
        solids.append(_between((-width, start, z - 0.004), (width, far, z + 0.004)))
    bar = ((-width, far, shape.height(0.26) - 0.004), (width, shape.end, shape.height(0.82) + 0.004))
    return [*solids, _between(*bar)]


def _between(a: tuple[float, float, float], b: tuple[float, float, float]) -> Solid:
    return slab((a[0], min(a[1], b[1]), a[2]), (b[0], max(a[1], b[1]), b[2]))


def _ear(shape: _Shape) -> Mesh:
    """Return the handle as it is seen: a flat rod bent to a D."""
    reach = shape.end - shape.side * _HANDLE_DEPTH / 2
    path = []
    for k in range(11):
        angle = math.pi * (k / 10 - 0.5)
        out, up = abs(math.cos(angle)) ** 0.5, math.copysign(abs(math.sin(angle)) ** 0.75, math.sin(angle))
        share = 0.54 + 0.28 * up
        wall = shape.wall(share) - shape.side * 0.0015
        path.append((0.0, wall + (reach - wall) * out, shape.height(share)))
    return tube(path, _HANDLE_WIDTH / 2, _HANDLE_DEPTH / 2, 8)


def _grips(shape: _Shape) -> tuple[Grip, ...]:
    """Return grips of the handle from outside, and of the rim from above: opposite the handle, beside it."""
    bar = (0.0, shape.end - shape.side * _HANDLE_DEPTH / 2, shape.height(0.54))
    radius, z = shape.rim - _WALL / 2, shape.top - 0.010
    up = (0.0, 0.0, 1.0)
    return (
        Grip("handle", bar, up, (0.0, shape.side, 0.0), _HANDLE_WIDTH),
        Grip("rim_across", (0.0, shape.middle - shape.side * radius, z), (1.0, 0.0, 0.0), up, _WALL),
        Grip("rim_front", (radius, shape.middle, z), (0.0, 1.0, 0.0), up, _WALL),
        Grip("rim_back", (-radius, shape.middle, z), (0.0, 1.0, 0.0), up, _WALL),
    )


# A glaze runs from the middle of the underside (the picture's lower edge) over the wall to the lip.


def _porcelain() -> Image:
    pattern = 0.5 + 0.5 * textures.noise(128, 64, 81, 8)
    return textures.blend(pattern, (232, 232, 230), (248, 248, 246))


def _red() -> Image:
    picture = textures.blend(textures.noise(128, 64, 83, 8), (176, 14, 16), (202, 24, 24))
    picture[:5] = (240, 236, 228)
    return picture


def _white_yellow() -> Image:
    picture = textures.blend(textures.noise(128, 64, 85, 8), (238, 236, 228), (250, 249, 244))
    picture[62:] = (242, 184, 28)
    picture[56:59] = (242, 184, 28)
    return picture
