"""Restoration of a policy's images: a wrapper around any policy, as in the paper's recovery study.

It looks at each image alone: no training, no clean image, no state of the simulator, no word of an event, and
nothing kept from one query to the next.

The limits of damage are the paper's. It does not name its high-pass filter; here it is that of Immerkær (Fast
noise variance estimation, 1996), which answers 0 to constant and linear brightness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.contract import Policy, Query
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.worlds.contract import Image, Observation

Mask = NDArray[np.uint8]
"""(H, W): 1 where an image is covered, 0 elsewhere."""

NOISE_LIMIT = 12.0
"""Estimated noise from which an image counts as damaged, grey levels."""
COVERED_LIMIT = 0.035
"""Covered share of the image from which it counts as damaged."""
BLACK = 2
"""The largest value that any channel of a covered pixel has."""
LEAST_SHARE, LEAST_SIDE_PX, LEAST_FILL = 0.002, 8, 0.85
"""Least size of a black area that counts as a cover: its share of the image, both sides of its
bounding box, and its share of that box."""
MOST_COVERED = 0.3
"""Share of the image above which no cover is believed, and none is marked."""

_HIGH_PASS = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
_HIGH_PASS.setflags(write=False)
_GAIN = 6.0  # root of the sum of the squares above: what the filter makes of independent noise
_MEDIAN_OF_NORMAL = 0.6744897501960817  # of the absolute value, in standard deviations
_GREEN = 1


@dataclass(frozen=True)
class Quality:
    """Damage found in an image."""

    noise: float
    """Standard deviation of the noise, grey levels, 0 to 255."""
    mask: Mask

    @property
    def covered(self) -> float:
        """Share of the image that is covered, 0 to 1."""
        return float(self.mask.mean())

    @property
    def is_noisy(self) -> bool:
        """True if the noise reaches its limit."""
        return self.noise >= NOISE_LIMIT

    @property
    def is_covered(self) -> bool:
        """True if the covered share reaches its limit."""
        return self.covered >= COVERED_LIMIT

    @property
    def damaged(self) -> bool:
        """True if the image is to be restored."""
        return self.is_noisy or self.is_covered


def assess(image: Image) -> Quality:
    """Judge an image, (H, W, 3) uint8, in any orientation."""
    mask = cover_of(image)
    return Quality(noise_of(image, mask), mask)


def cover_of(image: Image) -> Mask:
    """Return the black rectangles that cover an image."""
    import cv2

    black = (image.max(axis=2) <= BLACK).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(black, connectivity=8)
    mask = np.zeros(black.shape, dtype=np.uint8)
    for number in range(1, count):
        width, height, area = (
            int(stats[number, k]) for k in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_AREA)
        )
        if (
            area >= LEAST_SHARE * black.size
            and min(width, height) >= LEAST_SIDE_PX
            and area >= LEAST_FILL * width * height
        ):
            mask[labels == number] = 1
    return mask if mask.mean() <= MOST_COVERED else np.zeros_like(mask)


def noise_of(image: Image, mask: Mask) -> float:
    """Return the standard deviation of the noise outside covers and their edges, grey levels.

    The median of the filter's answers is hardly moved by the few that come from edges of things. Noise that
    was cut off at 0 or 255 is missing from it.
    """
    import cv2

    green = np.ascontiguousarray(image[..., _GREEN]).astype(np.float32)
    response = np.abs(cv2.filter2D(green, cv2.CV_32F, _HIGH_PASS))
    near = cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8)) if mask.any() else mask
    clear = response[1:-1, 1:-1][near[1:-1, 1:-1] == 0]
    return float(np.median(clear)) / (_MEDIAN_OF_NORMAL * _GAIN) if clear.size else 0.0


RestoreMode = Literal["always", "gated"]
RESTORE_MODES: tuple[RestoreMode, ...] = get_args(RestoreMode)
"""``always``: every image is restored. ``gated``: those that look damaged are."""

INPAINT_RADIUS_PX = 3.0
BILATERAL_DIAMETER_PX, BILATERAL_COLOUR, BILATERAL_SPACE_PX = 5, 45.0, 2.0

COUNTS = ("queries", "active", "images", "restored", "noisy", "covered")
"""Counts: queries, those at which an image was restored; images, those restored, over a limit."""
RESTORE_TIME = "restore_s"
"""Among the timings of a pair: time of judging and restoring."""


def restore(image: Image, mask: Mask) -> Image:
    """Return an image, (H, W, 3) uint8 in any orientation, with covered parts painted over and then smoothed.

    The first is Telea's method, the second a bilateral filter. The (H, W) mask is 1 where it is covered.
    """
    import cv2

    whole = np.ascontiguousarray(image)
    if mask.any():
        whole = np.asarray(cv2.inpaint(whole, mask, INPAINT_RADIUS_PX, cv2.INPAINT_TELEA), dtype=np.uint8)
    smooth = cv2.bilateralFilter(whole, BILATERAL_DIAMETER_PX, BILATERAL_COLOUR, BILATERAL_SPACE_PX)
    return np.asarray(smooth, dtype=np.uint8)


class RestoringPolicy(WrappedPolicy):
    """Shows a policy restored images.

    Attributes:
        query_seconds: Time spent on judging and restoring then.

    Args:
        mode: ``always`` or ``gated``.

    Raises:
        AdapterError: The policy asks for no images, so there is nothing to restore.
    """

    modes = RESTORE_MODES

    def __init__(self, policy: Policy, mode: RestoreMode = "gated") -> None:
        if mode not in RESTORE_MODES:
            raise AdapterError.seen(
                "mode", mode, f" of a RestoringPolicy. {did_you_mean(mode, RESTORE_MODES)}"
            )
        if not policy.spec.cameras:
            raise AdapterError.seen(
                "restore",
                mode,
                f" with policy {policy.spec.name!r}, which asks for no images (cameras=()), so "
                "nothing can be restored. Leave restore out of --libero-max-wrap.",
            )
        super().__init__(policy, f"restore={mode}")
        self._mode = mode
        self.query_notes: Mapping[str, int] = {}
        self.query_seconds: Mapping[str, float] = {}

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        start = perf_counter()
        shown, self.query_notes = self._restored(observation)
        self.query_seconds = {RESTORE_TIME: perf_counter() - start}
        return self.inner.predict(shown, query)

    def seen(self, observation: Observation) -> Observation:
        return self._restored(observation)[0]

    def _restored(self, observation: Observation) -> tuple[Observation, dict[str, int]]:
        counts = {**dict.fromkeys(COUNTS, 0), "queries": 1}
        shown: dict[str, NDArray[Any]] = dict(observation)
        for camera in self.spec.cameras:
            key = f"{camera}_image"
            quality = assess(observation[key])
            act = self._mode == "always" or quality.damaged
            if act:
                shown[key] = restore(observation[key], quality.mask)
            counts["active"] |= act
            counts["images"] += 1
            counts["restored"] += act
            counts["noisy"] += quality.is_noisy
            counts["covered"] += quality.is_covered
        return shown, counts
