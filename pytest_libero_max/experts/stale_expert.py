"""The expert with its eyes shut after the first look: what a policy does that never notices a change.

It has the expert's skill and the expert's route, as it was at the first query, and follows it to the end.
It feels its own hand, so its movements are precise; where things are it never looks up again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_libero_max.experts.expert import carry_out, stages
from pytest_libero_max.experts.motion import Route, follow
from pytest_libero_max.experts.scene_view import look_at_hand
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation


class StaleExpertPolicy:
    """Plans once. What it remembers is the route that is left."""

    spec = PolicySpec("stale-expert", horizon=10, query_interval=5, privileged=True)

    def reset(self, episode: Episode) -> None:
        self._world: Any = episode.world
        self._route: Route = ()

    def predict(self, observation: Observation, query: Query) -> np.ndarray:
        hand = look_at_hand(self._world)
        if not self._route:
            for fact in stages(self._world):
                self._route = (*self._route, *carry_out(self._world, fact, hand))
        actions, left = follow(hand, self._route, self.spec.horizon)
        self._route = left[self.spec.query_interval - 1]
        return actions

    def snapshot(self) -> Route:
        return self._route

    def restore(self, memory: Route) -> None:
        self._route = memory


policy = StaleExpertPolicy
