"""The moka pot and the frying pan."""

from __future__ import annotations

import math

from pytest_libero_max.substrates.embedded.meshes import Mesh, box, faceted, join, revolve, tube
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Grip,
    Link,
    Skin,
    Solid,
    slab,
    wall_ring,
)
from pytest_libero_max.worlds import rotations

_HALF_TURN = (0.0, 0.0, 0.0, 1.0)
_QUARTER_TURN = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
_ALUMINIUM, _BLACK, _IRON = (0.74, 0.75, 0.77), (0.07, 0.07, 0.08), (0.17, 0.17, 0.18)


def moka_pot() -> Category:
    """Return an eight-sided aluminium coffee pot with a black handle (-y) and knob, 152 mm high."""
    bottom, waist, collar, lid, top = -0.0661, 0.0000, 0.0580, 0.0685, 0.0857
    base, neck, crown, knob = 0.0400, 0.0265, 0.0330, 0.0090
    solids = [
        Solid((0.0, 0.0, bottom + 0.002), (0.68 * base, 0.68 * base, 0.002)),
        *_octagon(base, bottom + 0.0003, -0.028),
        *_octagon((base + neck) / 2, -0.028, waist),
        *_octagon((neck + crown) / 2, waist, collar),
        slab((-0.020, -0.020, collar), (0.020, 0.020, lid)),
        slab((-knob, -knob, lid), (knob, knob, top)),
        slab((-0.011, crown - 0.004, 0.030), (0.011, 0.0563, collar - 0.002)),
        # The handle: a bar at the lid, a grip that hangs from its end.
        slab((-0.0065, -0.0912, 0.050), (0.0065, -crown + 0.003, 0.064)),
        slab((-0.0065, -0.0912, -0.004), (0.0065, -0.0772, 0.050)),
    ]
    body = faceted(
        _eight_sided(
            [
                (0.0, bottom),
                (base - 0.002, bottom),
                (base, bottom + 0.003),
                (base, bottom + 0.012),
                (base * 0.97, bottom + 0.014),
                (neck + 0.002, waist - 0.006),
                (neck + 0.005, waist - 0.005),
                (neck + 0.005, waist + 0.003),
                (neck, waist + 0.004),
                (crown, collar),
                (crown + 0.002, collar + 0.001),
                (crown * 0.5, lid - 0.001),
                (0.0, lid),
            ]
        )
    )
    spout = faceted(_spout(crown, 0.0563, 0.028, collar))
    handle = join(
        tube(
            [
                (0.0, -crown + 0.004, 0.055),
                (0.0, -0.050, 0.057),
                (0.0, -0.070, 0.0575),
                (0.0, -0.081, 0.053),
                (0.0, -0.0845, 0.042),
                (0.0, -0.0842, 0.020),
                (0.0, -0.0835, -0.003),
            ],
            0.0065,
            0.0068,
        ),
        revolve(
            [
                (0.004, lid - 0.001),
                (0.0045, lid + 0.004),
                (knob, lid + 0.008),
                (knob, top - 0.004),
                (0.006, top),
                (0.0, top),
            ],
            12,
            crease_deg=60,
        ),
    )
    grips = (
        Grip("handle", (0.0, -0.0842, 0.022), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), 0.013),
        Grip("handle_top", (0.0, -0.066, 0.057), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.013),
        Grip("knob", (0.0, 0.0, top - 0.007), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2 * knob),
    )
    skins = (
        Skin(join(body, spout), _ALUMINIUM, shine=0.9),
        Skin(handle, _BLACK, shine=0.4),
    )
    return Category(
        "moka_pot",
        Link("main", 0.068243, solids, skins, grips=grips),
        upright=_HALF_TURN,
        origin_height=-bottom,
    )


def _octagon(apothem: float, low: float, high: float) -> list[Solid]:
    """Return an eight-sided prism whose flat sides face the axes, as four crossing slabs."""
    reach, middle, half = apothem * math.tan(math.pi / 8), (low + high) / 2, (high - low) / 2
    return [
        Solid((0.0, 0.0, middle), (apothem, reach, half), rotations.about((0, 0, 1), k * math.pi / 4))
        for k in range(4)
    ]


def _eight_sided(profile: list[tuple[float, float]]) -> Mesh:
    """Return a surface of revolution with eight flat sides, those of :func:`_octagon`; radii are apothems."""
    corner = 1 / math.cos(math.pi / 8)
    turn = rotations.matrix(rotations.about((0, 0, 1), math.pi / 8))
    return revolve([(radius * corner, z) for radius, z in profile], 8).moved(turn=turn)


def _spout(start: float, end: float, low: float, high: float) -> Mesh:
    """Return a beak: a triangular channel that widens upwards along +y."""
    import numpy as np

    lip, tip = np.array([0.0, end, high + 0.001]), np.array([0.0, start - 0.003, low])
    left, right = np.array([-0.013, start - 0.004, high]), np.array([0.013, start - 0.004, high])
    corners = np.array([tip, right, lip, tip, lip, left, left, lip, right])
    count = len(corners)
    return Mesh(corners, np.zeros((count, 3)), np.zeros((count, 2)), np.arange(count).reshape(-1, 3))


def chefmate_8_frypan() -> Category:
    """Return a black frying pan, 200 mm wide, its handle along +y."""
    bottom, rim, foot, edge, wall = 0.0008, 0.0480, 0.0740, 0.1015, 0.004
    solids = [
        Solid((0.0, 0.0, bottom + 0.002), (0.68 * foot, 0.68 * foot, 0.002)),
        *_octagon(foot, bottom + 0.0012, bottom + 0.006),
        *wall_ring(16, (foot, bottom + 0.0016), (edge, rim), wall),
    ]
    lean = math.atan2(0.012, 0.165)
    turn = rotations.about((1, 0, 0), lean)
    handle = Solid((0.0, 0.1750, 0.0472), (0.0105, 0.0805, 0.0060), turn)
    pan = revolve(
        [
            (0.0, bottom),
            (foot - 0.003, bottom),
            (foot, bottom + 0.002),
            (0.088, 0.020),
            (edge, rim - 0.001),
            (edge, rim),
            (edge - 0.003, rim),
        ],
        32,
    )
    inside = revolve(
        [
            (edge - 0.003, rim),
            (0.085, 0.021),
            (foot - 0.003, bottom + 0.0065),
            (0.0, bottom + 0.006),
        ],
        32,
    )
    grip = box(handle.half, 0.004, atlas=False).moved(handle.pos, turn=rotations.matrix(turn))
    neck = box((0.008, 0.012, 0.004), 0.002, atlas=False).moved(
        (0.0, 0.094, 0.041), turn=rotations.matrix(turn)
    )
    skins = (
        Skin(join(pan, neck), (0.30, 0.30, 0.32), shine=0.6),
        Skin(inside, _IRON, shine=0.3),
        Skin(grip, _BLACK, shine=0.3),
    )
    return Category(
        "chefmate_8_frypan",
        Link(
            "main",
            0.050247,
            (*solids, handle),
            skins,
            grips=(Grip("handle", (0.0, 0.190, 0.0484), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.021),),
        ),
        upright=_QUARTER_TURN,
        origin_height=-bottom,
    )
