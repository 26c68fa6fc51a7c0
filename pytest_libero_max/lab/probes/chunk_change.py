"""Disagreement of an answer with the one before it, about the steps that both plan."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.pairing.probes.monitor import Monitor
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation

_Chunk = tuple[int, tuple[tuple[float, ...], ...]]


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
        """Return the answer, and its distance from the one before."""
        before = np.array(memory[1])[step - memory[0] :] if memory else actions[:0]
        both = min(len(before), len(actions))
        difference = actions[:both] - before[:both] if both else np.zeros(1)
        return (step, tuple(map(tuple, actions.tolist()))), float(np.sqrt(np.mean(difference**2)))
