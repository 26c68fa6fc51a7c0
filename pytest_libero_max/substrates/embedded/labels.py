"""Labels of groceries: flat shapes and block letters, drawn the same by every version of every library."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.substrates.embedded.meshes import FACES
from pytest_libero_max.substrates.embedded.textures import Rgb, plain
from pytest_libero_max.worlds.contract import Array, Image

Mask = NDArray[np.bool_]

# Each pixel of an edge is judged at this many points in either direction.
_SUBPIXELS = 3

# Seven rows of five pixels for each capital letter, the leftmost pixel in the highest bit.
_LETTERS = MappingProxyType(
    {
        "A": "0E 11 11 1F 11 11 11",
        "B": "1E 11 11 1E 11 11 1E",
        "C": "0E 11 10 10 10 11 0E",
        "D": "1E 11 11 11 11 11 1E",
        "E": "1F 10 10 1E 10 10 1F",
        "F": "1F 10 10 1E 10 10 10",
        "G": "0E 11 10 17 11 11 0E",
        "H": "11 11 11 1F 11 11 11",
        "I": "0E 04 04 04 04 04 0E",
        "J": "07 02 02 02 02 12 0C",
        "K": "11 12 14 18 14 12 11",
        "L": "10 10 10 10 10 10 1F",
        "M": "11 1B 15 15 11 11 11",
        "N": "11 19 19 15 13 13 11",
        "O": "0E 11 11 11 11 11 0E",
        "P": "1E 11 11 1E 10 10 10",
        "Q": "0E 11 11 11 15 12 0D",
        "R": "1E 11 11 1E 14 12 11",
        "S": "0F 10 10 0E 01 01 1E",
        "T": "1F 04 04 04 04 04 04",
        "U": "11 11 11 11 11 11 0E",
        "V": "11 11 11 11 11 0A 04",
        "W": "11 11 11 15 15 1B 11",
        "X": "11 11 0A 04 0A 11 11",
        "Y": "11 11 0A 04 04 04 04",
        "Z": "1F 01 02 04 08 10 1F",
        " ": "00 00 00 00 00 00 00",
    }
)


class Label:
    """A picture to draw on, in units of its own size: x to the right and y down, both 0 to 1."""

    def __init__(self, colour: Rgb, width: int = 128, height: int = 128) -> None:
        self.image = plain(colour, height, width)
        self._width, self._height = width, height

    def band(self, top: float, bottom: float, colour: Rgb) -> Label:
        """Draw a horizontal stripe."""
        return self.block(0.0, top, 1.0, bottom, colour)

    def block(self, left: float, top: float, right: float, bottom: float, colour: Rgb) -> Label:
        """Draw a rectangle."""
        return self._fill(
            (left, top, right, bottom),
            lambda x, y: (x >= left) & (x < right) & (y >= top) & (y < bottom),
            colour,
        )

    def disc(self, x: float, y: float, radius: float, colour: Rgb, squeeze: float = 1.0) -> Label:
        """Draw a disc; ``radius`` in parts of the width, ``squeeze`` is height over width in pixels."""
        high = radius * squeeze * self._width / self._height
        bounds = (x - radius, y - high, x + radius, y + high)
        return self._fill(
            bounds, lambda px, py: ((px - x) / radius) ** 2 + ((py - y) / high) ** 2 <= 1.0, colour
        )

    def polygon(self, points: Sequence[tuple[float, float]], colour: Rgb) -> Label:
        """Draw a filled polygon, by the even-odd rule."""
        xs, ys = [x for x, _ in points], [y for _, y in points]

        def inside(px: Array, py: Array) -> Mask:
            result = np.zeros(np.broadcast(px, py).shape, bool)
            for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True):
                if y0 != y1:
                    crosses = (y0 > py) != (y1 > py)
                    result ^= crosses & (px < (x1 - x0) * (py - y0) / (y1 - y0) + x0)
            return result

        return self._fill((min(xs), min(ys), max(xs), max(ys)), inside, colour)

    def word(self, text: str, x: float, y: float, width: float, height: float, colour: Rgb) -> Label:
        """Draw capital letters centred at (x, y) that fill ``width`` by ``height``."""
        bits = _bits(text)
        rows, columns = bits.shape
        left, top = x - width / 2, y - height / 2

        def inside(px: Array, py: Array) -> Mask:
            row = np.clip(np.floor((py - top) / height * rows).astype(int), 0, rows - 1)
            # Strokes half as wide again as a pixel of the letters, so that they survive minification.
            shifts = [np.floor((px - left) / width * columns + shift).astype(int) for shift in (-0.25, 0.25)]
            left_half, right_half = (bits[row, np.clip(column, 0, columns - 1)] for column in shifts)
            mask: Mask = left_half | right_half
            return mask

        return self._fill((left, top, left + width, top + height), inside, colour)

    def _fill(
        self, bounds: tuple[float, float, float, float], inside: Callable[[Array, Array], Mask], colour: Rgb
    ) -> Label:
        """Blend a colour in wherever ``inside`` holds, within a rectangle that contains the shape."""
        x0, x1 = (
            int(np.clip(np.floor(v * self._width) + d, 0, self._width))
            for v, d in ((bounds[0], 0), (bounds[2], 1))
        )
        y0, y1 = (
            int(np.clip(np.floor(v * self._height) + d, 0, self._height))
            for v, d in ((bounds[1], 0), (bounds[3], 1))
        )
        if x0 >= x1 or y0 >= y1:
            return self
        n = _SUBPIXELS
        px = (x0 + (np.arange((x1 - x0) * n) + 0.5) / n) / self._width
        py = (y0 + (np.arange((y1 - y0) * n) + 0.5) / n) / self._height
        mask = np.broadcast_to(inside(px[None, :], py[:, None]), (len(py), len(px)))
        share = mask.reshape(y1 - y0, n, x1 - x0, n).mean(axis=(1, 3))[..., None]
        region = self.image[y0:y1, x0:x1]
        region[:] = np.rint(region * (1 - share) + np.asarray(colour) * share).astype(np.uint8)
        return self


def box_atlas(faces: Mapping[str, Image], cell: int = 96) -> Image:
    """Return the six pictures of a box, in the layout that :func:`.meshes.box` expects.

    Args:
        faces: Picture by face name; a face that is absent takes the picture of ``front``.
        cell: Edge length of each picture in the atlas, pixels.
    """
    pictures = [_resized(faces.get(face, faces["front"]), cell) for face in FACES]
    return np.vstack([np.hstack(pictures[:3]), np.hstack(pictures[3:])])


def _resized(picture: Image, size: int) -> Image:
    """Return the picture stretched to a square, every new pixel the mean of the area it covers."""
    result = picture.astype(np.float64)
    for axis in (0, 1):
        fine = math.lcm(result.shape[axis], size)
        parts = np.repeat(result, fine // result.shape[axis], axis=axis)
        shape = list(parts.shape)
        shape[axis : axis + 1] = [size, fine // size]
        result = parts.reshape(shape).mean(axis=axis + 1)
    return np.rint(result).astype(np.uint8)


def _bits(text: str) -> Mask:
    """(7, 6 n - 1) letters side by side with a pixel between them."""
    columns: list[Mask] = []
    for letter in text:
        rows = [int(row, 16) for row in _LETTERS[letter].split()]
        columns.append(np.array([[bool(row >> (4 - k) & 1) for k in range(5)] + [False] for row in rows]))
    return np.hstack(columns)[:, :-1]
