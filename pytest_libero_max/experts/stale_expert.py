"""The expert that never looks again: the behaviour of a policy that does not notice a change.

At the first query it plans the expert's route for the whole task, and follows it to the end. It reads its own
hand at every query, so its movements are as precise as the expert's, but never again where anything else is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.expert import plan_subgoal, subgoals
from pytest_libero_max.experts.motion import Route, follow
from pytest_libero_max.experts.scene_view import privileged_world, read_hand
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation


class StaleExpertPolicy:
    """Plans once. Its memory is the rest of the route."""

    spec = PolicySpec("stale-expert", horizon=10, query_interval=5, privileged=True)

    def reset(self, episode: Episode) -> None:
        """Forget the route, and keep the world to read."""
        self._world = privileged_world(episode, self.spec)
        self._route: Route = ()

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        hand = read_hand(self._world)
        if not self._route:
            for fact in subgoals(self._world):
                self._route = (*self._route, *plan_subgoal(self._world, fact, hand))
        actions, left = follow(hand, self._route, self.spec.horizon)
        self._route = left[self.spec.query_interval - 1]
        return actions

    def snapshot(self) -> Route:
        return self._route

    def restore(self, memory: Route) -> None:
        self._route = memory


VERSION = 1
"""See :func:`.references.shipped_version`."""

policy = StaleExpertPolicy
