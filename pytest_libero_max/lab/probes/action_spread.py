"""Spread of the motions within an answer."""

from __future__ import annotations

from pytest_libero_max.pairing.probes.monitor import Monitor
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation


class ActionSpread(Monitor[None]):
    """Standard deviation of the motions that an answer plans, averaged over the six components."""

    name = "action_spread"
    cost = "nothing to speak of"

    def observe(
        self, memory: None, observation: Observation, actions: Actions, step: int
    ) -> tuple[None, float]:
        """Return no memory, and the spread; grippers do not count."""
        return None, float(actions[:, :6].std(axis=0).mean())
