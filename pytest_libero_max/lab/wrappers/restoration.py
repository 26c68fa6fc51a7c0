"""Restoration of a policy's images: a wrapper around any policy, as in the paper's recovery study.

It looks at each image alone: no training, no clean image, no state of the simulator, no word of an event, and
nothing kept from one query to the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.lab.wrappers.image_quality import Mask, assess
from pytest_libero_max.policies.contract import Policy, Query
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.worlds.contract import Image, Observation

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
    """Return an image with covered parts painted over (Telea), then smoothed (bilateral filter).

    Args:
        image: (H, W, 3) uint8, in any orientation.
        mask: (H, W), 1 where it is covered.
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
