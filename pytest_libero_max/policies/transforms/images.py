"""Images on their way to a model: orientation, size, and the forms in which they are sent.

Images are (H, W, 3) uint8, RGB, as the world delivers them: the first row is the *bottom* of the picture.
"""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.worlds.contract import Image

if TYPE_CHECKING:
    from PIL.Image import Image as Picture


def rotate_180(image: Image) -> Image:
    """Turn the image by half a turn, ``[::-1, ::-1]``, as most models were trained."""
    return np.ascontiguousarray(_checked(image)[::-1, ::-1])


def flip_rows(image: Image) -> Image:
    """Reverse the order of the rows, ``[::-1]``: upright for a person, and not a rotation."""
    return np.ascontiguousarray(_checked(image)[::-1])


def resize_with_pad(image: Image, side_px: int) -> Image:
    """Fit the whole image into a square, its proportions kept, padded with black; bilinear, as in openpi.

    A size that does not come out whole is rounded down, and so is the border above and on the left.
    """
    height, width = _checked(image).shape[:2]
    side_px = _side(side_px)
    if height == width == side_px:
        return np.array(image)
    ratio = max(width / side_px, height / side_px)
    new_height, new_width = max(1, int(height / ratio)), max(1, int(width / ratio))
    top, left = (side_px - new_height) // 2, (side_px - new_width) // 2
    square = np.zeros((side_px, side_px, 3), dtype=np.uint8)
    square[top : top + new_height, left : left + new_width] = _resized(
        image, new_height, new_width, "BILINEAR"
    )
    return square


def resize_bilinear(image: Image, side_px: int) -> Image:
    """Resize the image to a square; bilinear with antialiasing, as Pillow computes it."""
    return _resized(_checked(image), _side(side_px), side_px, "BILINEAR")


def resize_bicubic(image: Image, side_px: int) -> Image:
    """Resize the image to a square; bicubic with antialiasing, which is Pillow's default."""
    return _resized(_checked(image), _side(side_px), side_px, "BICUBIC")


def resize_lanczos(image: Image, side_px: int) -> Image:
    """Resize the image to a square; Lanczos (three lobes) with antialiasing, as Pillow computes it."""
    return _resized(_checked(image), _side(side_px), side_px, "LANCZOS")


def resize_area(image: Image, side_px: int) -> Image:
    """Resize the image to a square; each pixel the mean of the area it covers, as OpenCV's ``INTER_AREA``."""
    import cv2

    side_px = _side(side_px)
    return np.asarray(cv2.resize(_checked(image), (side_px, side_px), interpolation=cv2.INTER_AREA), np.uint8)


def centre_crop(image: Image, share: float) -> Image:
    """Crop a square image to its middle, ``share`` of its area: the side is ``int(side * sqrt(share))``."""
    height, width = _checked(image).shape[:2]
    side = int(height * math.sqrt(share)) if 0.0 < share <= 1.0 else 0
    if height != width or side < 1:
        raise AdapterError(
            f"centre_crop of an image of shape {image.shape} to share={share!r} of its area, but it takes a "
            "square image and a share above 0 and up to 1."
        )
    start = (height - side) // 2
    return np.ascontiguousarray(image[start : start + side, start : start + side])


def jpeg_round_trip(image: Image, quality: int = 95) -> Image:
    """Compress the image as JPEG and unpack it, for models whose training images were JPEG files."""
    from PIL import Image as pillow

    if not 1 <= quality <= 100:
        raise AdapterError.seen("quality", quality, " of a JPEG file, but must be 1 to 100.")
    with pillow.open(io.BytesIO(_file(image, "JPEG", quality=quality))) as picture:
        return np.asarray(picture.convert("RGB"))


def png_file(image: Image) -> bytes:
    """Return the image as the content of a PNG file, without loss."""
    return _file(image, "PNG")


def side_by_side(*images: Image) -> Image:
    """One image of several of the same height, from left to right."""
    if len({_checked(image).shape[0] for image in images}) != 1:
        shapes = ", ".join(str(image.shape) for image in images)
        raise AdapterError(
            f"Images of shapes {shapes} cannot stand side by side: give them one height first."
        )
    return np.concatenate(images, axis=1)


def to_unit(image: Image) -> NDArray[np.float32]:
    """Scale the image to float32 from 0 to 1."""
    return _checked(image).astype(np.float32) / np.float32(255.0)


def to_signed(image: Image) -> NDArray[np.float32]:
    """Scale the image to float32 from -1 to 1."""
    return to_unit(image) * np.float32(2.0) - np.float32(1.0)


def channels_first(image: NDArray[Any]) -> NDArray[Any]:
    """(3, H, W) of (H, W, 3), any type."""
    return np.ascontiguousarray(np.moveaxis(image, -1, 0))


def _checked(image: Image) -> Image:
    if not isinstance(image, np.ndarray) or image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        seen = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise AdapterError(f"An image is an (H, W, 3) uint8 array, not {seen}. Convert its form last.")
    return image


def _side(side_px: int) -> int:
    if isinstance(side_px, bool) or not isinstance(side_px, int) or side_px < 1:
        raise AdapterError.seen("side_px", side_px, ", but the side of an image is an integer of at least 1.")
    return side_px


def _resized(image: Image, height: int, width: int, filter: str) -> Image:
    from PIL.Image import Resampling

    return np.asarray(_picture(image).resize((width, height), Resampling[filter]))


def _file(image: Image, kind: str, **options: Any) -> bytes:
    content = io.BytesIO()
    _picture(_checked(image)).save(content, kind, **options)
    return content.getvalue()


def _picture(image: Image) -> Picture:
    from PIL import Image as pillow

    return pillow.fromarray(np.ascontiguousarray(image))
