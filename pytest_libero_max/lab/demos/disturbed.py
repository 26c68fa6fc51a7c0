"""An expert whose hand is pushed aside now and then, so that its demonstrations show how to come back.

A learned policy errs, and then sees states that no undisturbed demonstration shows. The remedy is that of
DART (Laskey et al., 2017): disturb the execution, and record the expert's answers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.policies.contract import Episode, Policy, Query
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.worlds.contract import Observation

_ASIDE, _TURN = 1.0, 0.2
"""The largest push, in units of an action: sideways and up, and about each axis."""


class DisturbedPolicy(WrappedPolicy):
    """Adds a random movement to some answers; the gripper's command stays the expert's.

    Attributes:
        meant: Answer of the expert to each query of the episode.

    Args:
        share: Share of the queries whose answer is disturbed, 0 to 1.
    """

    def __init__(self, expert: Policy, share: float) -> None:
        super().__init__(expert, f"disturbed={share:g}")
        self.meant: list[NDArray[np.float64]] = []
        self._share = share

    def reset(self, episode: Episode) -> None:
        self.meant = []
        super().reset(episode)

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        actions = super().predict(observation, query)
        self.meant.append(actions)
        draw = np.random.default_rng(query.seed)
        if draw.uniform() >= self._share:
            return actions
        push = np.zeros(7)
        angle, length = draw.uniform(-np.pi, np.pi), _ASIDE * np.sqrt(draw.uniform())
        push[:3] = length * np.cos(angle), length * np.sin(angle), draw.uniform(0.0, _ASIDE)
        push[3:6] = draw.uniform(-_TURN, _TURN, 3)
        return np.clip(actions + push, -1.0, 1.0)

    def meant_at(self, steps: list[int], length: int) -> NDArray[np.float64]:
        """Actions that the expert wanted at each step.

        Args:
            steps: The step of each query.

        Returns:
            (length, 7) actions.
        """
        ends = [*steps[1:], length]
        return np.concatenate(
            [answer[: end - step] for answer, step, end in zip(self.meant, steps, ends, strict=True)]
        )
