"""Textures that a scene can have besides its own: covers of walls, floors, tables and objects.

Pictures of our own, pure functions like those of :mod:`.textures`; each tiles in both directions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from pytest_libero_max.substrates.embedded.textures import Rgb, blend, noise, wood
from pytest_libero_max.worlds.contract import Array, Image

PREFIX = "surface_"
"""A surface called ``marble_white`` is the texture ``surface_marble_white`` of a scene that has it."""

_SIZE = 256


def bricks(dark: Rgb, light: Rgb, joint: Rgb, seed: int, rows: int = 8) -> Image:
    """Rows of bricks, every second one shifted by half a brick."""
    tall, wide = _SIZE // rows, 2 * _SIZE // rows
    y, x = np.mgrid[0:_SIZE, 0:_SIZE]
    row = y // tall
    shifted = (x + (row % 2) * wide // 2) % _SIZE
    column = shifted // wide
    tone = noise(rows, rows, seed)[row, column % rows]
    picture = blend(0.65 * tone + 0.35 * noise(_SIZE, _SIZE, seed + 1, 4), dark, light)
    picture[(y % tall < 2) | (shifted % wide < 2)] = joint
    return picture


def marble(ground: Rgb, vein: Rgb, seed: int) -> Image:
    """Stone with a few soft veins."""
    warp = 0.6 * noise(_SIZE, _SIZE, seed, 64) + 0.3 * noise(_SIZE, _SIZE, seed + 1, 32)
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] / _SIZE
    wave = np.abs(np.sin(2 * np.pi * (x + y + 1.3 * warp)))
    return blend(0.5 * (1.0 - wave) ** 5 + 0.15 * noise(_SIZE, _SIZE, seed + 2, 4), ground, vein)


def fabric(warp: Rgb, weft: Rgb, seed: int, threads: int = 64) -> Image:
    """Return a plain weave of two yarns."""
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] * threads / _SIZE
    over = (np.floor(x) + np.floor(y)) % 2
    bulge = np.sin(np.pi * (y % 1)) * np.sin(np.pi * (x % 1))
    picture = blend(over, warp, weft).astype(np.float64)
    shade = 0.7 + 0.3 * bulge[..., None] + 0.12 * (noise(_SIZE, _SIZE, seed, 8)[..., None] - 0.5)
    woven: Image = np.rint((picture * shade).clip(0, 255)).astype(np.uint8)
    return woven


def checked(light: Rgb, dark: Rgb, seed: int, squares: int = 4) -> Image:
    """Return a chequered tablecloth: half tones where a light and a dark stripe cross."""
    stripe = (np.arange(_SIZE) * squares * 2 // _SIZE) % 2
    tone = (stripe[:, None] + stripe[None, :]) / 2
    return blend(tone + 0.06 * (noise(_SIZE, _SIZE, seed, 2) - 0.5), light, dark)


def tiled(dark: Rgb, light: Rgb, joint: Rgb, seed: int, count: int = 4) -> Image:
    """Square tiles, each of a slightly different tone."""
    side = _SIZE // count
    y, x = np.mgrid[0:_SIZE, 0:_SIZE]
    tone = noise(count, count, seed)[y // side, x // side]
    picture = blend(0.5 * tone + 0.5 * noise(_SIZE, _SIZE, seed + 1, 16), dark, light)
    picture[(y % side < 2) | (x % side < 2)] = joint
    return picture


def rough(dark: Rgb, light: Rgb, seed: int, grain: int = 2) -> Image:
    """Plaster, concrete, cork or cardboard, by colour and grain."""
    pattern = 0.4 * noise(_SIZE, _SIZE, seed, 32) + 0.25 * noise(_SIZE, _SIZE, seed + 1, 8)
    return blend(pattern + 0.35 * noise(_SIZE, _SIZE, seed + 2, grain), dark, light)


def cobbles(dark: Rgb, light: Rgb, joint: Rgb, seed: int, count: int = 8) -> Image:
    """Round stones in staggered rows."""
    side = _SIZE / count
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] / side
    row = np.floor(y).astype(int)
    shifted = (x + 0.5 * (row % 2)) % count
    column = np.floor(shifted).astype(int)
    away: Array = np.hypot(shifted % 1 - 0.5, y % 1 - 0.5)
    tone = 0.6 * noise(count, count, seed)[row % count, column % count]
    picture = blend(
        tone + 0.4 * noise(_SIZE, _SIZE, seed + 1, 4) - 0.9 * np.maximum(away - 0.3, 0), dark, light
    )
    picture[away > 0.47] = joint
    return picture


def carbon(seed: int) -> Image:
    """Dark twill."""
    y, x = np.mgrid[0:_SIZE, 0:_SIZE] // 8
    pattern = ((x + y) % 4 < 2) * 0.6 + 0.25 * noise(_SIZE, _SIZE, seed, 2)
    return blend(pattern, (20, 21, 24), (84, 88, 96))


SURFACES: Mapping[str, Callable[[], Image]] = MappingProxyType(
    {
        "bricks_grey": lambda: bricks((104, 104, 106), (150, 150, 148), (196, 196, 192), 101),
        "bricks_red": lambda: bricks((128, 48, 36), (182, 84, 62), (206, 198, 186), 103),
        "carbon": lambda: carbon(105),
        "cardboard": lambda: rough((158, 118, 76), (190, 150, 104), 107, 4),
        "cobbles": lambda: cobbles((92, 90, 86), (158, 152, 142), (60, 58, 54), 109),
        "concrete": lambda: rough((118, 118, 116), (162, 162, 158), 111, 2),
        "cork": lambda: rough((112, 74, 40), (206, 158, 106), 113, 2),
        "fabric_blue": lambda: fabric((32, 58, 120), (64, 96, 170), 115),
        "fabric_checked": lambda: checked((246, 242, 236), (178, 28, 36), 117),
        "fabric_green": lambda: fabric((28, 84, 52), (70, 132, 84), 119),
        "fabric_gold": lambda: fabric((176, 128, 36), (226, 182, 80), 153),
        "fabric_linen": lambda: fabric((206, 196, 174), (232, 224, 206), 121),
        "marble_black": lambda: marble((34, 34, 38), (214, 212, 206), 123),
        "marble_green": lambda: marble((46, 92, 72), (206, 220, 208), 125),
        "marble_red": lambda: marble((122, 48, 44), (226, 196, 186), 159),
        "marble_white": lambda: marble((236, 234, 230), (120, 120, 126), 127),
        "plaster_blue": lambda: rough((36, 52, 92), (58, 78, 126), 129, 2),
        "plaster_cream": lambda: rough((226, 212, 172), (246, 236, 206), 131, 2),
        "plaster_green": lambda: rough((34, 70, 52), (58, 102, 78), 133, 2),
        "plaster_grey": lambda: rough((84, 86, 92), (118, 120, 126), 155, 2),
        "plaster_rose": lambda: rough((188, 128, 124), (222, 168, 160), 135, 2),
        "tiles_blue": lambda: tiled((52, 96, 158), (104, 150, 206), (232, 234, 236), 137),
        "tiles_terracotta": lambda: tiled((150, 78, 46), (196, 116, 76), (216, 200, 182), 139),
        "tiles_white": lambda: tiled((224, 226, 226), (246, 246, 244), (150, 152, 154), 141),
        "wood_ash": lambda: wood(_SIZE, (182, 158, 124), (226, 206, 174), 5, 143),
        "wood_cherry": lambda: wood(_SIZE, (110, 44, 26), (164, 82, 52), 4, 147),
        "wood_oak": lambda: wood(_SIZE, (140, 98, 58), (194, 150, 100), 6, 157),
        "wood_ebony": lambda: wood(_SIZE, (36, 26, 22), (78, 58, 48), 6, 151),
    }
)
"""Every surface by name."""


def shown(name: str) -> str:
    """Return the name of a surface's texture in a scene."""
    return PREFIX + name
