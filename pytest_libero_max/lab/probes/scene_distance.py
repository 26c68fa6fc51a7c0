"""Distance of the image from that of the first query, in a small feature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.pairing.probes.monitor import IMAGE_SIZE, Monitor
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation

_CELLS = 8
"""Cells of the feature, a side."""


class SceneDistance(Monitor[tuple[float, ...]]):
    """Distance of the scene camera's image from the first one, as 8 x 8 mean colours, in levels of 255.

    It stands for monitors that measure how far an embedding is from what is known, without a network.
    """

    name = "scene_distance"
    cost = "one image of 64 pixels a query"
    cameras = ("agentview",)

    def observe(
        self, memory: tuple[float, ...] | None, observation: Observation, actions: Actions, step: int
    ) -> tuple[tuple[float, ...], float]:
        """Return the first feature, and the root mean square distance from it."""
        feature = _feature(observation["agentview_image"])
        first = memory or tuple(feature.tolist())
        return first, float(np.sqrt(np.mean((feature - first) ** 2)))


def _feature(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the mean colours of the cells of a (64, 64, 3) image. Shape (192,)."""
    side = IMAGE_SIZE // _CELLS
    cells = image.reshape(_CELLS, side, _CELLS, side, 3).astype(np.float64)
    means: NDArray[np.float64] = cells.mean(axis=(1, 3))
    return means.ravel()
