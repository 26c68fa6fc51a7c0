"""Procedural textures, and how they are written into a compiled model.

Every picture is (H, W, 3) uint8, row 0 on top, a pure function of its arguments: noise comes from a fixed
integer hash of the pixel's place, never from a generator whose stream could change.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.worlds.contract import Array, Image

if TYPE_CHECKING:
    import mujoco

Rgb = tuple[int, int, int]


def upload(model: mujoco.MjModel, pictures: Mapping[str, Image]) -> None:
    """Write the pictures into the textures of a compiled model that bear their names.

    Call it once after compiling and before a renderer is made; MuJoCo hands textures to the GPU when a
    context opens.

    Args:
        model: Compiled from an MJCF that declares the textures with the pictures' sizes.
        pictures: (H, W, 3) uint8 by texture name.
    """
    for name, picture in pictures.items():
        texture = model.texture(name).id
        start = int(model.tex_adr[texture])
        data = np.ascontiguousarray(picture[::-1]).ravel()
        model.tex_data[start : start + data.size] = data


def noise(height: int, width: int, seed: int, cell: int = 1) -> Array:
    """Smooth noise from 0 to 1 that tiles in both directions.

    Args:
        height: Rows; a multiple of ``cell``.
        width: Columns; a multiple of ``cell``.
        cell: Distance of the random values in pixels; between them it is interpolated.
    """
    rows, columns = height // cell, width // cell
    grid_y, grid_x = np.mgrid[0:rows, 0:columns].astype(np.uint32)
    value = (
        grid_x * np.uint32(374761393) + grid_y * np.uint32(668265263) + np.uint32(seed * 974634777 % 2**32)
    )
    value = (value ^ (value >> np.uint32(13))) * np.uint32(1274126177)
    grid = ((value ^ (value >> np.uint32(16))) & np.uint32(0xFFFF)).astype(np.float64) / 65535.0
    y, x = np.arange(height) / cell, np.arange(width) / cell
    y0, x0 = np.floor(y).astype(int), np.floor(x).astype(int)
    ty, tx = (_ease(y - y0))[:, None], (_ease(x - x0))[None, :]
    y1, x1 = (y0 + 1) % rows, (x0 + 1) % columns
    top = grid[np.ix_(y0, x0)] * (1 - tx) + grid[np.ix_(y0, x1)] * tx
    bottom = grid[np.ix_(y1, x0)] * (1 - tx) + grid[np.ix_(y1, x1)] * tx
    field: Array = top * (1 - ty) + bottom * ty
    return field


def _ease(t: Array) -> Array:
    eased: Array = t * t * (3 - 2 * t)
    return eased


def blend(pattern: Array, dark: Rgb, light: Rgb) -> Image:
    """Colours between ``dark`` (pattern 0) and ``light`` (pattern 1)."""
    p = np.clip(pattern, 0.0, 1.0)[..., None]
    return np.rint(np.asarray(dark) * (1 - p) + np.asarray(light) * p).astype(np.uint8)


def plain(colour: Rgb, height: int = 64, width: int = 64) -> Image:
    """One colour."""
    return np.full((height, width, 3), colour, np.uint8)


def wood(
    size: int = 256, dark: Rgb = (128, 84, 48), light: Rgb = (178, 128, 82), planks: int = 0, seed: int = 1
) -> Image:
    """Wood with its grain along u; ``planks`` > 0 draws that many boards with seams."""
    wave = 0.6 * noise(size, size, seed, size // 4) + 0.3 * noise(size, size, seed + 1, size // 8)
    rows = np.arange(size)[:, None] / size
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (10 * rows + 1.6 * wave))
    stretched = np.repeat(noise(size, size // 8, seed + 2, 2), 8, axis=1)[:, :size]
    pattern = 0.35 * rings + 0.35 * wave + 0.35 * stretched
    if planks:
        board = (np.arange(size) * planks) // size
        tone = np.array([noise(4, 4, seed + 10 + int(b))[0, 0] for b in board])[:, None]
        pattern = pattern * 0.7 + 0.3 * tone
        seam = (np.arange(size) * planks) % size < planks * 2
        pattern[seam] *= 0.35
    return blend(pattern, dark, light)


def plaster(size: int = 256) -> Image:
    """Light gray rough wall."""
    pattern = (
        0.5 * noise(size, size, 31, 32) + 0.3 * noise(size, size, 32, 8) + 0.2 * noise(size, size, 33, 2)
    )
    return blend(pattern, (196, 194, 188), (226, 225, 220))


def linen(size: int = 256) -> Image:
    """Pale yellow woven wall covering."""
    y, x = np.mgrid[0:size, 0:size]
    weave = 0.5 + 0.25 * np.where(x % 4 < 2, 1, -1) * np.where(y % 4 < 2, 1, -1)
    pattern = 0.5 * noise(size, size, 35, 16) + 0.3 * noise(size, size, 36, 2) + 0.2 * weave
    return blend(pattern, (206, 186, 128), (240, 224, 176))


def tiles(
    size: int = 256,
    joints: int = 2,
    dark: Rgb = (150, 150, 148),
    light: Rgb = (184, 184, 180),
    seam: Rgb = (118, 118, 116),
) -> Image:
    """Floor tiles, ``joints`` by ``joints`` of them; light gray by default."""
    pattern = (
        0.5 * noise(size, size, 41, 64) + 0.3 * noise(size, size, 42, 16) + 0.2 * noise(size, size, 43, 4)
    )
    picture = blend(pattern, dark, light)
    line = (np.arange(size) * joints) % size < 2 * joints
    picture[line] = seam
    picture[:, line] = seam
    return picture


def wicker(size: int = 128, strands: int = 8) -> Image:
    """Basket weave."""
    y, x = np.mgrid[0:size, 0:size] * strands / size
    over = (np.floor(x) + np.floor(y)) % 2 == 0
    across = np.where(over, y % 1, x % 1)
    along = np.where(over, x % 1, y % 1)
    pattern = np.sin(np.pi * across) * (0.55 + 0.45 * np.sin(np.pi * along)) + 0.15 * noise(size, size, 51, 4)
    return blend(pattern, (82, 50, 24), (204, 156, 96))
