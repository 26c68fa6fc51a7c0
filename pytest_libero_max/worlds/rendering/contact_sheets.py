"""Contact sheets: many small pictures with captions in one file, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from pytest_libero_max.worlds.contract import Image

_LINE_PX = 16
_FONT_SCALE = 0.33
_INK, _PAPER = (40, 40, 40), (255, 255, 255)
LETTER_PX = 5.4
"""Width of a letter of a caption, on average."""


def captioned(image: Image, *lines: str) -> Image:
    """Return a picture, (H, W, 3) uint8 upright, under some lines of text."""
    import cv2

    strip = np.full((_LINE_PX * len(lines), image.shape[1], 3), _PAPER, np.uint8)
    for number, text in enumerate(lines):
        place = (3, _LINE_PX * number + 12)
        cv2.putText(strip, text, place, cv2.FONT_HERSHEY_SIMPLEX, _FONT_SCALE, _INK, 1, cv2.LINE_AA)
    framed = np.vstack([strip, image])
    framed[:, -1] = _PAPER
    return framed


def resized(image: Image, size: int) -> Image:
    """Return a square picture at another size, (size, size, 3) uint8."""
    import cv2

    small: Image = cv2.resize(image, (size, size), interpolation=cv2.INTER_AREA).astype(np.uint8)
    return small


def wrapped(text: str, width_px: int) -> list[str]:
    """Return a caption in lines that fit a picture of this width."""
    return wrap(text, int(width_px / LETTER_PX))


def write_sheet(path: Path, pictures: Sequence[Image], columns: int, *, colour_step: int = 4) -> None:
    """Lay pictures out in rows and write them; the folder is made if missing.

    Args:
        path: The file to write; a name in ``.jpg`` suits noisy pictures, ``.webp`` small ones, ``.png``
            all others.
        pictures: (H, W, 3) uint8 each, of one width, and of one height in a row.
        columns: Pictures in a row; the last row is filled up with white.
        colour_step: Colours are rounded to multiples of it, which makes the file smaller: 4 is invisible and
            saves a third.
    """
    import cv2

    quality = {
        ".png": (cv2.IMWRITE_PNG_COMPRESSION, 9),
        ".jpg": (cv2.IMWRITE_JPEG_QUALITY, 80),
        ".webp": (cv2.IMWRITE_WEBP_QUALITY, 60),
    }
    blank = np.full_like(pictures[-1], 255)
    tiles = [*pictures, *[blank] * (-len(pictures) % columns)]
    sheet = np.vstack([np.hstack(tiles[n : n + columns]) for n in range(0, len(tiles), columns)])
    rounded = np.minimum(np.round(sheet / colour_step) * colour_step, 255).astype(np.uint8)
    _, encoded = cv2.imencode(path.suffix, rounded[..., ::-1], quality[path.suffix])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encoded.tobytes())
