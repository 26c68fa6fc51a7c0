"""Packets, cartons, tins and bottles: shapes that differ in size, label and colour.

Sizes are those of the upright object: depth along x (towards ``agentview``), width along y, height along z.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pytest_libero_max.substrates.embedded.meshes import Mesh, atlas_cell, box, join, panel, revolve
from pytest_libero_max.substrates.embedded.objects.parts import Category, Colour, Link, Skin, Solid, Vector
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import Quaternion

# LIBERO's tins and bottles have y up in their own frames.
TIN_UPRIGHT: Quaternion = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
BOTTLE_UPRIGHT: Quaternion = (0.5, 0.5, 0.5, 0.5)


def packet(
    name: str,
    size: Vector,
    mass: float,
    label: Callable[[], Image],
    height: float,
    margin: float,
    upright: Quaternion,
) -> Category:
    """Return a box with a box-atlas label whose origin lies ``height`` above the bottom."""
    half = (size[0] / 2, size[1] / 2, size[2] / 2)
    lift = half[2] - height
    skin = Skin(box(half, chamfer=0.0012).moved((0.0, 0.0, lift)), texture="label")
    main = Link("main", mass, (Solid((0.0, 0.0, lift), half),), (skin,))
    return Category(name, main, False, upright, height, margin, {"label": label})


def carton(
    name: str, size: Vector, mass: float, label: Callable[[], Image], height: float, margin: float
) -> Category:
    """Return a drink carton with a gabled top; ``height`` as in :func:`packet`."""
    half_x, half_y = size[0] / 2, size[1] / 2
    shoulder, ridge, top = size[2] * 0.76 - height, size[2] * 0.925 - height, size[2] - height
    body = (half_x, half_y, (shoulder + height) / 2)
    middle = (shoulder - height) / 2
    gable = 0.004
    solids = (
        Solid((0.0, 0.0, middle), body),
        Solid((0.0, 0.0, (shoulder + ridge) / 2), (half_x * 0.55, half_y, (ridge - shoulder) / 2)),
        Solid((0.0, 0.0, (ridge + top) / 2), (gable, half_y, (top - ridge) / 2)),
    )
    mesh = join(box(body).moved((0.0, 0.0, middle)), _roof(half_x, half_y, gable, shoulder, ridge, top))
    main = Link("main", mass, solids, (Skin(mesh, texture="label"),))
    return Category(name, main, False, BOTTLE_UPRIGHT, height, margin, {"label": label})


def can(
    name: str, radius: float, length: float, mass: float, label: Callable[[], Image], height: float
) -> Category:
    """Return a tin; its round wall collides as four crossing slabs that stand on a square foot."""
    bottom, top = -height, length - height
    middle, half = (bottom + top) / 2, (top - bottom) / 2
    reach = radius * math.tan(math.pi / 8)
    solids = [Solid((0.0, 0.0, bottom + 0.002), (0.68 * radius, 0.68 * radius, 0.002))]
    for k in range(4):
        turn = rotations.about((0, 0, 1), k * math.pi / 4)
        # Only the foot touches the ground: four contacts there are enough.
        solids.append(Solid((0.0, 0.0, middle + 0.0003), (radius, reach, half - 0.0003), turn))
    wall = revolve([(radius, bottom + 0.003), (radius, top - 0.003)], 20)
    rim = radius + 0.0008
    lids = [
        revolve([(0.0, bottom), (rim, bottom), (rim, bottom + 0.003), (radius, bottom + 0.0032)], 20),
        revolve(
            [
                (radius, top - 0.0032),
                (rim, top - 0.003),
                (rim, top),
                (rim - 0.003, top),
                (rim - 0.004, top - 0.002),
                (0.0, top - 0.002),
            ],
            20,
        ),
    ]
    skins = (Skin(wall, texture="label"), Skin(join(*lids), (0.78, 0.79, 0.8), shine=0.8))
    return Category(
        name, Link("main", mass, solids, skins), False, TIN_UPRIGHT, height, 0.025, {"label": label}
    )


def bottle(
    name: str,
    size: Vector,
    mass: float,
    label: Callable[[], Image],
    height: float,
    *,
    glass: Colour,
    cap: Colour,
    neck: float,
    shoulder: float,
    cap_width: float,
    margin: float = 0.025,
    upright: Quaternion = BOTTLE_UPRIGHT,
) -> Category:
    """Return a flattened bottle; ``height`` as in :func:`packet`.

    Args:
        name: LIBERO's category.
        size: Depth, width and height in m.
        mass: In kg.
        height: Of the origin above the bottom, m.
        neck: Height at which the cap begins, as a part of the whole.
        shoulder: Height at which the body ends, as a part of the whole.
        cap_width: Diameter of the cap, m.
        margin: LIBERO's ``horizontal_radius``, m.
    """
    flat = size[0] / size[1]
    radius, bottom = size[1] / 2, -height
    z = {part: bottom + size[2] * part for part in (0.0, shoulder, neck, 1.0)}
    cap_radius = cap_width / 2
    body_half = (size[0] / 2 * 0.97, radius * 0.97, (z[shoulder] - bottom) / 2)
    solids = (
        Solid((0.0, 0.0, (z[shoulder] + bottom) / 2), body_half),
        Solid(
            (0.0, 0.0, (z[neck] + z[shoulder]) / 2),
            (max(size[0] / 2 * 0.7, cap_radius), (radius + cap_radius) / 2, (z[neck] - z[shoulder]) / 2),
        ),
        Solid(
            (0.0, 0.0, (z[1.0] + z[neck]) / 2), (cap_radius * 0.95, cap_radius * 0.95, (z[1.0] - z[neck]) / 2)
        ),
    )
    low, high = bottom + 0.08 * size[2], z[shoulder] - 0.02 * size[2]
    base = [(0.0, bottom), (radius * 0.86, bottom), (radius * 0.98, bottom + 0.004), (radius, low)]
    upper = [
        (radius, high),
        (radius * 0.96, z[shoulder]),
        ((radius * 0.8 + cap_radius * 0.2), (z[shoulder] * 0.55 + z[neck] * 0.45)),
        (cap_radius * 0.9, z[neck]),
    ]
    squeeze = (flat, 1.0, 1.0)
    wrap = _superellipse(revolve([(radius, low), (radius, high)], 24), radius).moved(scale=squeeze)
    rest = _superellipse(join(revolve(base, 24), revolve(upper, 24, crease_deg=60)), radius).moved(
        scale=squeeze
    )
    lid = revolve(
        [
            (cap_radius, z[neck] - 0.001),
            (cap_radius * 0.94, z[1.0] - 0.003),
            (cap_radius * 0.84, z[1.0]),
            (0.0, z[1.0]),
        ],
        14,
    )
    skins = (Skin(wrap, texture="label", shine=0.4), Skin(rest, glass, shine=0.6), Skin(lid, cap, shine=0.3))
    return Category(name, Link("main", mass, solids, skins), False, upright, height, margin, {"label": label})


def _superellipse(mesh: Mesh, radius: float) -> Mesh:
    """Make the round cross-sections of a bottle squarer, more so the wider they are."""
    xy = mesh.vertices[:, :2]
    r = np.linalg.norm(xy, axis=1)
    angle = np.arctan2(xy[:, 1], xy[:, 0])
    exponent = 2.0 + 1.2 * np.clip(r / radius, 0, 1)
    stretch = (np.abs(np.cos(angle)) ** exponent + np.abs(np.sin(angle)) ** exponent) ** (-1 / exponent)
    # Keep the widest points where they were: only the corners move outwards.
    vertices = mesh.vertices.copy()
    vertices[:, :2] = xy * stretch[:, None]
    return Mesh(vertices, mesh.normals, mesh.texcoords, mesh.triangles)


def _roof(half_x: float, half_y: float, gable: float, low: float, ridge: float, top: float) -> Mesh:
    """Return the slopes, the folded ends and the sealed edge of a carton; the ridge runs along y."""
    u0, v0, u1, v1 = atlas_cell("top")
    u0, u1, v0, v1 = u0 + 0.01, u1 - 0.01, v0 + 0.01, v1 - 0.01
    side_u, _, _, side_v = atlas_cell("right")
    plain = [(side_u + 0.05, side_v - 0.02)] * 4
    outline = [(half_x, low), (gable, ridge), (gable, top)]
    heights = [v0, (v0 + v1) / 2, v1]
    parts = [
        panel(
            [(gable, -half_y, top), (gable, half_y, top), (-gable, half_y, top), (-gable, -half_y, top)],
            plain,
        )
    ]
    for (x0, z0), (x1, z1), low_v, high_v in zip(outline, outline[1:], heights, heights[1:], strict=False):
        for s in (1.0, -1.0):
            x, xx, y = s * x0, s * x1, s * half_y
            slope = [(x, -y, z0), (x, y, z0), (xx, y, z1), (xx, -y, z1)]
            parts.append(panel(slope, [(u0, low_v), (u1, low_v), (u1, high_v), (u0, high_v)]))
            parts.append(panel([(x, y, z0), (-x, y, z0), (-xx, y, z1), (xx, y, z1)], plain))
    return join(*parts)
