"""Bowl, plate and ramekin: round things with a thin wall that two fingers can pinch."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.meshes import revolve
from pytest_libero_max.substrates.embedded.objects.parts import Category, Link, Skin, Solid, wall_ring
from pytest_libero_max.substrates.embedded.textures import Rgb
from pytest_libero_max.worlds.contract import Image

_QUARTER_TURN = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def akita_black_bowl() -> Category:
    """Return a glossy black bowl, 107 mm wide and 51 mm high: a flaring lower wall, an almost upright rim."""
    bottom, top = 0.0016, 0.0521
    foot, waist, rim, wall = 0.029, 0.0490, 0.0535, 0.003
    shell = [
        (0.0, bottom + 0.002),
        (foot - 0.006, bottom + 0.002),
        (foot - 0.005, bottom),
        (foot, bottom),
        (foot + 0.001, bottom + 0.003),
        (0.040, 0.0105),
        (waist, 0.0225),
        (0.0522, 0.036),
        (rim, top - 0.001),
        (rim - 0.001, top),
        (rim - wall, top - 0.0005),
        (0.0490, 0.036),
        (0.0455, 0.0245),
        (0.036, 0.013),
        (0.022, 0.0075),
        (0.0, 0.0065),
    ]
    solids = (
        Solid((0.0, 0.0, (bottom + 0.0075) / 2), (0.022, 0.022, (0.0075 - bottom) / 2)),
        *wall_ring(8, (foot + 0.001, 0.0035), (waist, 0.0235), wall),
        *wall_ring(12, (waist, 0.0225), (rim, top), wall),
    )
    skin = Skin(revolve(shell, 28), (1.0, 1.0, 1.0), "glaze", shine=0.7)
    return Category(
        "akita_black_bowl",
        Link("main", 0.005591, solids, (skin,)),
        upright=_QUARTER_TURN,
        origin_height=-bottom,
        textures={"glaze": _black_glaze},
    )


def plate() -> Category:
    """Return a white plate with a blue line on its raised rim, 138 mm wide and 19 mm high."""
    bottom, top, rim = -0.0025, 0.0164, 0.0687
    face = [
        (0.0, bottom + 0.001),
        (0.038, bottom + 0.001),
        (0.039, bottom),
        (0.043, bottom),
        (0.046, bottom + 0.002),
        (0.058, 0.0070),
        (rim, top - 0.0012),
        (rim, top),
        (rim - 0.002, top),
        (0.057, 0.0100),
        (0.047, 0.0038),
        (0.044, 0.0022),
        (0.0, 0.002),
    ]
    solids = (
        Solid((0.0, 0.0, (bottom + 0.002) / 2), (0.031, 0.031, (0.002 - bottom) / 2)),
        *wall_ring(12, (0.0455, -0.0010), (rim, top), 0.0035),
    )
    skin = Skin(revolve(face, 32), (1.0, 1.0, 1.0), "rings", shine=0.5)
    return Category(
        "plate",
        Link("main", 0.011522, solids, (skin,)),
        upright=_QUARTER_TURN,
        origin_height=-bottom,
        textures={"rings": lambda: _rings((243, 241, 236), (44, 74, 140), [(0.555, 0.595), (0.63, 0.645)])},
    )


def glazed_rim_porcelain_ramekin() -> Category:
    """Return a small straight white baking dish with a caramel rim, 89 mm wide and 42 mm high."""
    bottom, top, rim, base, wall = 0.0007, 0.0427, 0.0446, 0.0400, 0.0042
    shell = [
        (0.0, bottom + 0.001),
        (base - 0.002, bottom + 0.001),
        (base - 0.001, bottom),
        (base, bottom + 0.001),
        (base + 0.0022, 0.018),
        (rim - 0.0012, 0.0365),
        (rim, 0.0370),
        (rim, top - 0.0008),
        (rim - 0.0008, top),
        (rim - wall + 0.0008, top),
        (rim - wall, top - 0.001),
        (base - wall, 0.010),
        (base - wall - 0.004, 0.0065),
        (0.0, 0.0065),
    ]
    solids = (
        Solid((0.0, 0.0, (bottom + 0.0065) / 2), (0.027, 0.027, (0.0065 - bottom) / 2)),
        *wall_ring(12, (base, 0.0015), (rim, top), wall),
    )
    skin = Skin(revolve(shell, 28), (1.0, 1.0, 1.0), "glaze", shine=0.6)
    return Category(
        "glazed_rim_porcelain_ramekin",
        Link("main", 0.00966, solids, (skin,)),
        upright=_QUARTER_TURN,
        origin_height=-bottom,
        textures={"glaze": lambda: _rings((244, 240, 230), (168, 112, 58), [(0.455, 0.56)])},
    )


def _black_glaze() -> Image:
    """Nearly black, a little lighter in streaks, with a worn brown rim."""
    streaks = textures.noise(128, 64, 61, 8)
    picture = textures.blend(streaks, (22, 22, 25), (46, 46, 52))
    rim = slice(int(128 * (1 - 0.585)), int(128 * (1 - 0.545)))
    picture[rim] = (104, 76, 52)
    return picture


def _rings(ground: Rgb, line: Rgb, spans: Sequence[tuple[float, float]]) -> Image:
    """Return a plain glaze with coloured lines at parts of the profile's length."""
    shade = (ground[0] - 12, ground[1] - 12, ground[2] - 12)
    picture = textures.blend(0.5 + 0.5 * textures.noise(256, 16, 71, 8), shade, ground)
    for low, high in spans:
        picture[int(256 * (1 - high)) : int(256 * (1 - low))] = line
    return picture
