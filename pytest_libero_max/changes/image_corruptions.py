"""Five image corruptions: motion blur, Gaussian blur, zoom blur, fog and frosted glass.

Each is a pure function of a float image (0 to 1), a level from 1 to 10 and a stream of random numbers. The
formulas and level tables are the published ones of the common image corruptions, for pictures 256 pixels
wide; lengths grow with the picture, so that a corruption looks the same at every size.

What a blur returns stands in memory that the next one in the same thread writes over.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float64]
Stream = np.random.RandomState

LEVELS = 10
_NOMINAL_WIDTH = 256

# Radius and deviation of the one-sided kernel, pixels.
_MOTION = (
    (5, 2.0),
    (8, 3.0),
    (10, 4.0),
    (12, 5.0),
    (15, 6.0),
    (18, 8.0),
    (20, 10.0),
    (25, 12.0),
    (30, 15.0),
    (35, 20.0),
)
_MOTION_ANGLE_DEG = 45.0
# Largest zoom factor, exclusive, and step between the factors in hundredths.
_ZOOM = ((11, 1), (16, 1), (21, 2), (26, 2), (31, 3), (36, 1), (41, 1), (46, 2), (51, 2), (56, 3))
# Amount of fog, and by how much its roughness falls from one scale to the next.
_FOG = (
    (0.5, 3.0),
    (1.0, 2.8),
    (1.5, 2.5),
    (2.0, 2.2),
    (2.5, 2.0),
    (3.0, 1.8),
    (3.5, 1.6),
    (4.0, 1.5),
    (4.5, 1.4),
    (5.0, 1.3),
)
_FOG_ROUGHNESS = 100.0
# Deviation of the blur before and after, largest shift (pixels), passes.
_GLASS = (
    (0.5, 1, 3),
    (0.7, 1, 3),
    (0.9, 2, 3),
    (1.0, 2, 2),
    (1.1, 3, 2),
    (1.3, 3, 2),
    (1.5, 4, 2),
    (1.8, 4, 2),
    (2.2, 5, 1),
    (2.5, 5, 1),
)

_SCRATCH = threading.local()


def motion(image: Picture, level: int, stream: Stream) -> Picture:
    """Motion blur in one direction, drawn for every picture within 45 degrees of the horizontal."""
    radius, deviation = _MOTION[level - 1]
    scale = _scale(image)
    steps = np.arange(2 * max(1, round(radius * scale)) + 1)
    weights = np.exp(-(steps**2) / (2.0 * (deviation * scale) ** 2))
    weights /= weights.sum()
    angle = math.radians(stream.uniform(-_MOTION_ANGLE_DEG, _MOTION_ANGLE_DEG))
    down = np.array([round(float(step) * math.sin(angle)) for step in steps])
    across = np.array([round(float(step) * math.cos(angle)) for step in steps])
    height, width, channels = image.shape
    padded = scratch("work", (height, (width + int(across.max())) * channels))
    from pytest_libero_max.changes import image_loops

    smeared = scratch("result", image.shape)
    image_loops.smear(np.ascontiguousarray(image), down, across, weights, padded, smeared)
    return smeared


def focus(image: Picture, level: int, stream: Stream) -> Picture:
    """Gaussian blur with a deviation of ``level`` pixels."""
    return _gaussian(image, level * _scale(image))


def zoom(image: Picture, level: int, stream: Stream) -> Picture:
    """Return the mean of the image and of its middle, enlarged ever more."""
    end, step = _ZOOM[level - 1]
    factors = [1.0 + hundredths / 100.0 for hundredths in range(0, end, step)]
    from pytest_libero_max.changes import image_loops

    tables = [_lines(size, factors) for size in image.shape[:2]]
    wide = scratch("work", (image.shape[0], image.shape[1] + 1, 4))
    mean = scratch("result", image.shape)
    image_loops.zoomed(np.ascontiguousarray(image), *tables[0], *tables[1], wide, mean)
    return mean


def fog(image: Picture, level: int, stream: Stream) -> Picture:
    """Clouds of a plasma fractal in front of the image."""
    amount, decay = _FOG[level - 1]
    height, width = image.shape[:2]
    side = 1 << max(1, math.ceil(math.log2(max(height, width))))
    clouds = plasma(side, decay, stream)[:height, :width, None]
    brightest = float(image.max())
    foggy = np.add(image, amount * clouds, out=scratch("result", image.shape))
    foggy *= brightest
    foggy /= brightest + amount
    return foggy


def glass(image: Picture, level: int, stream: Stream) -> Picture:
    """Blur, swap every pixel with one nearby, blur again."""
    deviation, shift, passes = _GLASS[level - 1]
    scale = _scale(image)
    reach = max(1, round(shift * scale))
    soft = _gaussian(image, deviation * scale, into="work")
    height, width = soft.shape[:2]
    order = np.arange(height * width)
    if height > 2 * reach and width > 2 * reach:
        from pytest_libero_max.changes import image_loops

        places = (height - 2 * reach) * (width - 2 * reach)
        for moves in stream.randint(0, 2 * reach, (passes, 2, places)):
            image_loops.swap(order, width, reach, moves)
    rough = scratch("rough", image.shape)
    np.take(
        soft.reshape(height * width, -1), order, axis=0, out=rough.reshape(height * width, -1), mode="clip"
    )
    return _gaussian(rough, deviation * scale)


KINDS: Mapping[str, Callable[[Picture, int, Stream], Picture]] = MappingProxyType(
    {
        "motion_blur": motion,
        "gaussian_blur": focus,
        "zoom_blur": zoom,
        "fog": fog,
        "glass_blur": glass,
    }
)
"""The five corruptions by name."""


def plasma(side: int, decay: float, stream: Stream) -> Picture:
    """Return a plasma fractal by the diamond-square method, (side, side), 0 to 1; it tiles both ways.

    Args:
        side: A power of two.
        decay: Above 1; the larger, the smoother.
    """
    from pytest_libero_max.changes import image_loops

    field: Picture = image_loops.diamonds(side, _FOG_ROUGHNESS, decay, stream.random_sample(side * side - 1))
    return field


def scratch(name: str, shape: tuple[int, ...]) -> Picture:
    """Return this thread's float array of a name, with whatever is in it, valid until the next request.

    Fresh memory for every image costs as long as some of the corruptions themselves.
    """
    size = math.prod(shape)
    kept: Picture | None = getattr(_SCRATCH, name, None)
    if kept is None or kept.size < size:
        kept = np.empty(size)
        setattr(_SCRATCH, name, kept)
    return kept[:size].reshape(shape)


def _scale(image: Picture) -> float:
    return float(image.shape[1] / _NOMINAL_WIDTH)


def _gaussian(image: Picture, deviation: float, into: str = "result") -> Picture:
    from pytest_libero_max.changes import image_loops

    radius = int(4.0 * deviation + 0.5)  # SciPy's, as are the sums' order and the weights
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-radius, radius + 1) ** 2)
    weights /= weights.sum()
    blurred = scratch(into, image.shape)
    image_loops.symmetric(np.ascontiguousarray(image), weights[radius:][::-1].copy(), blurred)
    return blurred


def _lines(size: int, factors: Sequence[float]) -> tuple[NDArray[np.int64], Picture]:
    """Return the lower of the two lines that each enlarged line mixes, and the upper one's share.

    Both are (factors, size).
    """
    centre = (size - 1) / 2.0
    at = (centre + (np.arange(size) - centre) / np.array(factors)[:, None]).clip(0.0, size - 1.0)
    low = np.minimum(at.astype(np.int64), max(size - 2, 0))
    return low, at - low
