"""Procedural pictures: materials, and the labels of the groceries.

Every picture is (H, W, 3) uint8, row 0 on top, a pure function of its arguments: noise comes from a fixed integer hash
of the pixel's place, never from a generator whose stream could change. OpenCV draws shapes and words.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.worlds.contract import Array, Image
from pytest_libero_max.worlds.embedded.meshes import FACES

if TYPE_CHECKING:
    import mujoco

Rgb = tuple[int, int, int]


def upload(model: mujoco.MjModel, pictures: Mapping[str, Image]) -> None:
    """Write the pictures into the textures of a compiled model that bear their names.

    Call it once after compiling and before a renderer is made; MuJoCo hands textures to the GPU when a context opens.

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
        seed: Selects the pattern.
        cell: Distance of the random values in pixels; between them it is interpolated.
    """
    rows, columns = height // cell, width // cell
    grid_y, grid_x = np.mgrid[0:rows, 0:columns].astype(np.uint32)
    value = grid_x * np.uint32(374761393) + grid_y * np.uint32(668265263) + np.uint32(seed * 974634777 % 2**32)
    value = (value ^ (value >> np.uint32(13))) * np.uint32(1274126177)
    grid = ((value ^ (value >> np.uint32(16))) & np.uint32(0xFFFF)).astype(np.float64) / 65535.0
    y, x = np.arange(height) / cell, np.arange(width) / cell
    y0, x0 = np.floor(y).astype(int), np.floor(x).astype(int)
    ty, tx = (_ease(y - y0))[:, None], (_ease(x - x0))[None, :]
    y1, x1 = (y0 + 1) % rows, (x0 + 1) % columns
    top = grid[np.ix_(y0, x0)] * (1 - tx) + grid[np.ix_(y0, x1)] * tx
    bottom = grid[np.ix_(y1, x0)] * (1 - tx) + grid[np.ix_(y1, x1)] * tx
    return top * (1 - ty) + bottom * ty


def _ease(t: Array) -> Array:
    return t * t * (3 - 2 * t)


def blend(pattern: Array, dark: Rgb, light: Rgb) -> Image:
    """Colours between ``dark`` (pattern 0) and ``light`` (pattern 1)."""
    p = np.clip(pattern, 0.0, 1.0)[..., None]
    return np.rint(np.asarray(dark) * (1 - p) + np.asarray(light) * p).astype(np.uint8)


def plain(colour: Rgb, height: int = 64, width: int = 64) -> Image:
    """One colour."""
    return np.full((height, width, 3), colour, np.uint8)


def wood(size: int = 256, dark: Rgb = (128, 84, 48), light: Rgb = (178, 128, 82), planks: int = 0, seed: int = 1) -> Image:
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
    pattern = 0.5 * noise(size, size, 31, 32) + 0.3 * noise(size, size, 32, 8) + 0.2 * noise(size, size, 33, 2)
    return blend(pattern, (196, 194, 188), (226, 225, 220))


def tiles(size: int = 256, joints: int = 2) -> Image:
    """Light gray floor tiles, ``joints`` by ``joints`` of them."""
    pattern = 0.5 * noise(size, size, 41, 64) + 0.3 * noise(size, size, 42, 16) + 0.2 * noise(size, size, 43, 4)
    picture = blend(pattern, (150, 150, 148), (184, 184, 180))
    line = (np.arange(size) * joints) % size < 2 * joints
    picture[line] = (118, 118, 116)
    picture[:, line] = (118, 118, 116)
    return picture


def wicker(size: int = 128, strands: int = 8) -> Image:
    """Basket weave."""
    y, x = np.mgrid[0:size, 0:size] * strands / size
    over = (np.floor(x) + np.floor(y)) % 2 == 0
    across = np.where(over, y % 1, x % 1)
    along = np.where(over, x % 1, y % 1)
    pattern = np.sin(np.pi * across) * (0.55 + 0.45 * np.sin(np.pi * along)) + 0.15 * noise(size, size, 51, 4)
    return blend(pattern, (82, 50, 24), (204, 156, 96))


def box_atlas(faces: Mapping[str, Image], cell: int = 96) -> Image:
    """The six pictures of a box, in the layout that :func:`.meshes.box` expects.

    Args:
        faces: Picture by face name; a face that is absent takes the picture of ``front``.
        cell: Edge length of each picture in the atlas, pixels.
    """
    import cv2

    atlas = np.zeros((2 * cell, 3 * cell, 3), np.uint8)
    for number, face in enumerate(FACES):
        picture = cv2.resize(faces.get(face, faces["front"]), (cell, cell), interpolation=cv2.INTER_AREA)
        row, column = divmod(number, 3)
        atlas[row * cell : (row + 1) * cell, column * cell : (column + 1) * cell] = picture
    return atlas


class Label:
    """A picture to draw on, in units of its own size: x to the right and y down, both 0 to 1.

    Args:
        colour: The ground.
        width: Pixels.
        height: Pixels.
    """

    def __init__(self, colour: Rgb, width: int = 128, height: int = 128) -> None:
        self.image = plain(colour, height, width)
        self._size = np.array([width, height])

    def _at(self, x: float, y: float) -> tuple[int, int]:
        return int(round(x * self._size[0])), int(round(y * self._size[1]))

    def band(self, top: float, bottom: float, colour: Rgb) -> Label:
        """A horizontal stripe."""
        self.image[self._at(0, top)[1] : self._at(0, bottom)[1]] = colour
        return self

    def block(self, left: float, top: float, right: float, bottom: float, colour: Rgb) -> Label:
        """A rectangle."""
        import cv2

        cv2.rectangle(self.image, self._at(left, top), self._at(right, bottom), colour, -1)
        return self

    def disc(self, x: float, y: float, radius: float, colour: Rgb, squeeze: float = 1.0) -> Label:
        """A disc; ``radius`` in parts of the width, ``squeeze`` its height over its width on the picture."""
        import cv2

        rx = int(round(radius * self._size[0]))
        ry = int(round(radius * self._size[0] * squeeze))
        cv2.ellipse(self.image, self._at(x, y), (rx, ry), 0, 0, 360, colour, -1, cv2.LINE_AA)
        return self

    def arc(self, x: float, y: float, radius: float, colour: Rgb, begin: float, end: float, weight: float) -> Label:
        """Part of a circle's line, degrees clockwise from the right; ``weight`` in parts of the width."""
        import cv2

        r = int(round(radius * self._size[0]))
        thickness = max(1, int(round(weight * self._size[0])))
        cv2.ellipse(self.image, self._at(x, y), (r, r), 0, begin, end, colour, thickness, cv2.LINE_AA)
        return self

    def polygon(self, points: list[tuple[float, float]], colour: Rgb) -> Label:
        """A filled polygon."""
        import cv2

        cv2.fillPoly(self.image, [np.array([self._at(x, y) for x, y in points], np.int32)], colour, cv2.LINE_AA)
        return self

    def word(self, text: str, x: float, y: float, width: float, height: float, colour: Rgb) -> Label:
        """A bold word centred at (x, y), as large as fits into ``width`` by ``height``."""
        import cv2

        font, base = cv2.FONT_HERSHEY_DUPLEX, 4.0
        (w, h), _ = cv2.getTextSize(text, font, base, 10)
        canvas = np.zeros((h + 24, w + 24), np.uint8)
        cv2.putText(canvas, text, (12, h + 12), font, base, 255, 14, cv2.LINE_AA)
        target = max(1, int(width * self._size[0])), max(1, int(height * self._size[1]))
        mask = cv2.resize(canvas, target, interpolation=cv2.INTER_AREA).astype(np.float64)[..., None] / 255.0
        left, top = self._at(x - width / 2, y - height / 2)
        region = self.image[top : top + target[1], left : left + target[0]]
        mask = mask[: region.shape[0], : region.shape[1]]
        region[:] = np.rint(region * (1 - mask) + np.asarray(colour) * mask).astype(np.uint8)
        return self
