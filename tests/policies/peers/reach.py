"""The policy of the servers of this folder, in process and as an adapter for `libero-max serve`."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_libero_max import PolicySpec

GOAL = np.array([0.1, -0.1, 0.5])


class Reach:
    """Moves the hand towards a place and closes the gripper; it costs nothing.

    Args:
        spec: What it declares.
        dtype: Of its actions: vla-eval rounds them to float32.
    """

    def __init__(self, spec: PolicySpec | None = None, dtype: type[np.floating[Any]] = np.float64) -> None:
        self.spec = spec or PolicySpec("reach", 10, 5)
        self._dtype = dtype

    def reset(self, episode: Any) -> None:
        pass

    def predict(self, observation: Any, query: Any) -> Any:
        move = np.clip((GOAL - observation["robot0_eef_pos"]) / 0.05, -1, 1)
        actions = np.tile([*move, 0, 0, 0, 1], (10, 1))[: self.spec.horizon]
        return actions.astype(self._dtype).astype(np.float64)


policy = Reach
