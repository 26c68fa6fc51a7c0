"""A policy around another one: common members, so that a wrapper has only those that it changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.check import sees
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation


class WrappedPolicy:
    """Hands everything on to the policy inside. Its spec names the wrapper (``restore=gated``).

    Memory, waiting times, ``close`` and all else that the policy inside offers are offered likewise, but for
    ``predict_batch``: the queries of a wrapped policy are answered one by one.
    """

    modes: ClassVar[tuple[str, ...]] = ()
    """Settings that ``--libero-max-wrap=NAME:SETTING`` can name."""

    def __init__(self, policy: Policy, words: str) -> None:
        if sees(policy):
            raise AdapterError(
                f"policy {policy.spec.name!r} is shown every step (see), but a wrapper ({words}) only "
                "changes what it is shown at queries. Leave the wrapper out."
            )
        self.inner = policy
        self._spec = replace(policy.spec, wrappers=(*policy.spec.wrappers, words))
        # A Protocol's isinstance looks for them on the object itself.
        for name in ("snapshot", "restore", "close"):
            if hasattr(policy, name):
                setattr(self, name, getattr(policy, name))
        if hasattr(policy, "model_inputs"):
            self.model_inputs = self._model_inputs

    @property
    def spec(self) -> PolicySpec:
        return self._spec

    @spec.setter
    def spec(self, spec: PolicySpec) -> None:
        self.inner.spec = replace(self.inner.spec, horizon=spec.horizon, query_interval=spec.query_interval)
        self._spec = spec

    def reset(self, episode: Episode) -> None:
        self.inner.reset(episode)

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        return self.inner.predict(self.seen(observation), query)

    def seen(self, observation: Observation) -> Observation:
        """Return the observation that the policy inside is shown."""
        return observation

    def _model_inputs(self, observation: Observation, query: Query) -> Any:
        return self.inner.model_inputs(self.seen(observation), query)  # type: ignore[attr-defined]

    def __getattr__(self, name: str) -> Any:
        if name in ("inner", "predict_batch"):
            raise AttributeError(name)
        return getattr(self.inner, name)
