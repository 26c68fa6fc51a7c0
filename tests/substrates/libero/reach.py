"""A policy that brings the hand to the first object of the goal, and does nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.policies.contract import Episode, PolicySpec, Query


class Reach:
    """Looks at both cameras, and mixes what it sees into the gripper's command so that pixels matter."""

    spec = PolicySpec(name="reach", horizon=40, query_interval=40, image_size=64, privileged=True)

    def reset(self, episode: Episode) -> None:
        world: Any = episode.world
        self.world = world
        subject = world.goal[0].subject  # an entity, or a region of one
        self.target = max((name for name in world.entities if subject.startswith(name)), key=len)

    def predict(self, observation: Mapping[str, NDArray[Any]], query: Query) -> NDArray[np.float64]:
        target = self.world.position(self.target)
        delta = np.clip((target - observation["robot0_eef_pos"]) / 0.05, -1.0, 1.0)
        seen = float(observation["agentview_image"].mean()) + float(
            observation["robot0_eye_in_hand_image"].mean()
        )
        actions = np.zeros((40, 7))
        actions[:12, :3] = delta * 0.6
        actions[:, 3] = seen / 5100.0
        actions[:, 6] = -1.0
        return actions


policy = Reach()
