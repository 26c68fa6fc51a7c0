"""The wine bottle and the rack that it is laid in."""

from __future__ import annotations

import math

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.labels import Label
from pytest_libero_max.substrates.embedded.meshes import Mesh, join, panel, revolve
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Grip,
    Link,
    Site,
    Skin,
    Solid,
    slab,
    slab_mesh,
)
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Image

_HALF_TURN = (0.0, 0.0, 0.0, 1.0)


def wine_bottle() -> Category:
    """Return a slim green bottle with a cream label and a red capsule, 43 mm wide and 157 mm high."""
    bottom, top, radius = 0.0011, 0.1580, 0.0217
    body_top, neck_low, neck = bottom + 0.088, bottom + 0.112, 0.0090
    middle, half = (body_top + bottom) / 2, (body_top - bottom) / 2
    reach = radius * math.tan(math.pi / 8)
    solids = [Solid((0.0, 0.0, bottom + 0.002), (0.68 * radius, 0.68 * radius, 0.002))]
    for k in range(4):
        turn = rotations.about((0, 0, 1), k * math.pi / 4)
        # Only the foot touches what the bottle stands on: four contacts there are enough.
        solids.append(Solid((0.0, 0.0, middle + 0.0003), (radius, reach, half - 0.0003), turn))
    solids.append(slab((-0.013, -0.013, body_top), (0.013, 0.013, neck_low)))
    solids.append(slab((-neck, -neck, neck_low), (neck, neck, top)))
    low, high = bottom + 0.018, bottom + 0.070
    glass = join(
        revolve(
            [(0.0, bottom + 0.003), (radius - 0.004, bottom), (radius, bottom + 0.004), (radius, low)], 20
        ),
        revolve(
            [
                (radius, high),
                (radius, body_top),
                (radius * 0.86, body_top + 0.008),
                (0.0125, body_top + 0.016),
                (neck, neck_low),
                (neck * 0.93, top - 0.035),
            ],
            20,
            crease_deg=60,
        ),
    )
    wrap = revolve([(radius + 0.0002, low), (radius + 0.0002, high)], 20)
    capsule = revolve(
        [
            (neck * 0.98, top - 0.036),
            (neck * 0.98, top - 0.007),
            (neck * 1.12, top - 0.006),
            (neck * 1.12, top - 0.001),
            (neck, top),
            (0.0, top),
        ],
        16,
    )
    skins = (
        Skin(glass, (0.07, 0.20, 0.10), shine=0.8),
        Skin(wrap, texture="label", shine=0.2),
        Skin(capsule, (0.62, 0.08, 0.12), shine=0.5),
    )
    grips = (
        Grip("neck", (0.0, 0.0, top - 0.022), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2 * neck),
        Grip("body", (0.0, 0.0, bottom + 0.055), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 2 * radius),
    )
    return Category(
        "wine_bottle",
        Link("main", 0.015394, solids, skins, grips=grips),
        upright=_HALF_TURN,
        origin_height=-bottom,
        textures={"label": _label},
    )


def _label() -> Image:
    label = Label((238, 226, 196), 256, 96).band(0.0, 0.07, (150, 112, 40)).band(0.93, 1.0, (150, 112, 40))
    for middle in (0.0, 0.5, 1.0):
        label.word("WINE", middle, 0.28, 0.28, 0.28, (110, 18, 36))
        for row, count in enumerate((3, 2, 1)):
            for k in range(count):
                x = middle + 0.045 * (k - (count - 1) / 2)
                label.disc(x, 0.55 + 0.13 * row, 0.026, (96, 28, 92), 0.9)
        label.polygon([(middle, 0.5), (middle + 0.06, 0.42), (middle + 0.09, 0.52)], (70, 120, 50))
    return label.image


_TIER_SLOPE = math.radians(26.5)
# Where the surfaces of the tiers begin: (y, z) of their lower ends, m.
_TIERS = ((-0.0800, 0.2095), (-0.1170, 0.0860))
_TIER_LENGTH, _TIER_HALF = 0.155, 0.1234
_SLOT_PITCH = 0.056
_RACK_LIFT = 0.015
_FEET = 0.020


def wine_rack() -> Category:
    """Return a wooden rack with two sloping tiers of three slots, 0.27 m wide and 0.33 m high, on four feet.

    A bottle lies in a slot with its bottom against the rail at the lower end (-y) and its neck up. The feet
    are an addition: LIBERO's rack hovers two centimetres over the table.
    """
    width = 0.1344
    boards, ridges = zip(*(_tier(y, z) for y, z in _TIERS), strict=True)
    tiers = [solid for part in (*boards, *ridges) for solid in part]
    lean = math.radians(15.8)
    turn = rotations.about((1, 0, 0), -lean)
    posts = [Solid((s * (width - 0.0055), 0.0089, 0.1683), (0.0055, 0.011, 0.1630), turn) for s in (-1, 1)]
    base = [
        slab((s * width - 0.011 * (s > 0), -0.1240, -0.0022), (s * width + 0.011 * (s < 0), 0.1290, 0.0140))
        for s in (-1, 1)
    ]
    bars = [
        slab((-width + 0.011, y - 0.008, -0.0002), (width - 0.011, y + 0.008, 0.0130))
        for y in (-0.075, 0.075)
    ]
    feet = [
        slab(
            (s * (width - 0.0055) - 0.0055, y - 0.008, -_FEET),
            (s * (width - 0.0055) + 0.0055, y + 0.008, -0.002),
        )
        for s in (-1, 1)
        for y in (-0.112, 0.117)
    ]
    frame = (*posts, *base, *bars, *feet)
    # LIBERO's quaternion: the region's z axis points up along the tier, its y axis into it.
    region = Site(
        "top_region",
        (0.0, -0.08003, 0.21745),
        (0.10087, 0.022, 0.00251),
        (0.854912, -0.518773, 0.0, 0.0),
    )
    skins = (
        Skin(slab_mesh([solid for tier in boards for solid in tier], 0.14), (1.0, 0.94, 0.86), "wood", 0.1),
        Skin(join(*(_surface(y, z) for y, z in _TIERS)), texture="slots", shine=0.1),
        Skin(slab_mesh([solid for tier in ridges for solid in tier], 0.14), (0.7, 0.6, 0.52), "wood", 0.1),
        Skin(slab_mesh(frame, 0.14), (0.62, 0.55, 0.5), "wood", 0.1),
    )
    return Category(
        "wine_rack",
        Link("main", 0.152748, (*tiers, *frame), skins, (region,)),
        fixture=True,
        textures={
            "wood": lambda: textures.wood(128, (134, 82, 42), (192, 134, 78), seed=15),
            "slots": _slots,
        },
        lift=_RACK_LIFT,
    )


def _slots() -> Image:
    """Return a tier seen from above, its lower end at the bottom: a bottle's outline in every slot."""
    label = Label((0, 0, 0), 256, 160)
    label.image[:] = textures.wood(256, (176, 122, 70), (226, 174, 114), seed=15)[:160]
    for slot in (-2, -1, 0, 1, 2):
        x = 0.5 + slot * _SLOT_PITCH / (2 * _TIER_HALF)
        right = [(x + side, y) for side, y in ((0.072, 0.93), (0.072, 0.48), (0.03, 0.34), (0.03, 0.1))]
        left = [(2 * x - edge, y) for edge, y in reversed(right)]
        label.polygon([*right, *left], (70, 38, 26))
    return label.image


def _surface(y: float, z: float) -> Mesh:
    """Skins on top of a tier."""
    length, over = _TIER_LENGTH, 0.0003
    outline = [(-_TIER_HALF, 0.0), (_TIER_HALF, 0.0), (_TIER_HALF, length), (-_TIER_HALF, length)]
    turn = rotations.matrix(rotations.about((1, 0, 0), _TIER_SLOPE))
    return panel([(x, along, over) for x, along in outline]).moved((0.0, y, z), turn=turn)


def _tier(y: float, z: float) -> tuple[list[Solid], list[Solid]]:
    """Return a sloping board whose surface begins at (y, z), and the ridges and the rail that are on it."""
    cos, sin = math.cos(_TIER_SLOPE), math.sin(_TIER_SLOPE)
    turn = rotations.about((1, 0, 0), _TIER_SLOPE)

    def part(x: float, along: float, over: float, half: tuple[float, float, float]) -> Solid:
        return Solid((x, y + along * cos - over * sin, z + along * sin + over * cos), half, turn)

    middle, thickness, ridge = _TIER_LENGTH / 2, 0.0045, 0.0045
    ridges = [
        part(x * _SLOT_PITCH, middle + 0.004, ridge, (0.004, middle - 0.004, ridge))
        for x in (-1.5, -0.5, 0.5, 1.5)
    ]
    return (
        [part(0.0, middle, -thickness, (_TIER_HALF, middle, thickness))],
        [*ridges, part(0.0, 0.003, 0.007, (_TIER_HALF, 0.003, 0.007))],
    )
