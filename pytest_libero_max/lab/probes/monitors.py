"""Failure monitors that come with the package: scores of answers alone, and of images."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.pairing.probes.monitor import IMAGE_SIZE, Monitor
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation

_Chunk = tuple[int, tuple[tuple[float, ...], ...]]

_CELLS = 8
"""Cells of the feature of an image, a side."""


class ActionSpread(Monitor[None]):
    """Standard deviation of the motions that an answer plans, averaged over the six components."""

    name = "action_spread"
    cost = "nothing to speak of"

    def observe(
        self, memory: None, observation: Observation, actions: Actions, step: int
    ) -> tuple[None, float]:
        return None, float(actions[:, :6].std(axis=0).mean())


class ChunkChange(Monitor[_Chunk]):
    """Root mean square of what two answers in a row differ by, over the steps that both plan.

    The consistency score of C. Agia et al. (2024), arXiv 2410.04640, for one answer a query. Always 0 where
    all that is answered is executed (H = Q).
    """

    name = "chunk_change"
    cost = "nothing to speak of"

    def observe(
        self, memory: _Chunk | None, observation: Observation, actions: Actions, step: int
    ) -> tuple[_Chunk, float]:
        before = np.array(memory[1])[step - memory[0] :] if memory else actions[:0]
        both = min(len(before), len(actions))
        difference = actions[:both] - before[:both] if both else np.zeros(1)
        return (step, tuple(map(tuple, actions.tolist()))), float(np.sqrt(np.mean(difference**2)))


class ImageChange(Monitor[bytes]):
    """Mean absolute difference of the scene camera's image from the one before, in levels of 255."""

    name = "image_change"
    cost = "one image of 64 pixels a query"
    cameras = ("agentview",)

    def observe(
        self, memory: bytes | None, observation: Observation, actions: Actions, step: int
    ) -> tuple[bytes, float]:
        image = observation["agentview_image"]
        before = np.frombuffer(memory or image.tobytes(), np.uint8).reshape(IMAGE_SIZE, IMAGE_SIZE, 3)
        return image.tobytes(), float(np.abs(image.astype(np.int64) - before).mean())


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
        feature = _feature(observation["agentview_image"])
        first = memory or tuple(feature.tolist())
        return first, float(np.sqrt(np.mean((feature - first) ** 2)))


def _feature(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the mean colours of the cells of a (64, 64, 3) image. Shape (192,)."""
    side = IMAGE_SIZE // _CELLS
    cells = image.reshape(_CELLS, side, _CELLS, side, 3).astype(np.float64)
    means: NDArray[np.float64] = cells.mean(axis=(1, 3))
    return means.ravel()
