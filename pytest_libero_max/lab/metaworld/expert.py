"""The fifty scripted policies of the package ``metaworld`` as one, which reads what the task observes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.lab.metaworld.robot import MT50, SAWYER
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation


class MetaworldExpert:
    """Asks the policy of the task at every step. Those policies have no memory and need no image."""

    spec = PolicySpec("metaworld-expert", cameras=(), privileged=True, suites=(MT50.name,), robot=SAWYER.name)

    def reset(self, episode: Episode) -> None:
        """Keep the world to read, and make the policy of its task.

        Raises:
            AdapterError: The world is none of Meta-World.
        """
        from metaworld.policies import ENV_POLICY_MAP

        from pytest_libero_max.lab.metaworld.world import MetaworldWorld

        if not isinstance(episode.world, MetaworldWorld):
            raise AdapterError(
                f"{self.spec.name} plays the tasks of Meta-World: --libero-max-substrate=metaworld."
            )
        self._world = episode.world
        kind: Any = ENV_POLICY_MAP[self._world.task]
        self._policy = kind()

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that actions will be clipped
            action = self._policy.get_action(self._world.task_observation())
        clipped: NDArray[np.float64] = np.clip(action, -1.0, 1.0, dtype=np.float64)
        return clipped[None]


VERSION = 1
"""See :func:`.references.shipped_version`."""

policy = MetaworldExpert
