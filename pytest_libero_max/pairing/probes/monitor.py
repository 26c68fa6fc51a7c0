"""Contract of a failure monitor: a probe that gives every query a score, higher where it is more alarmed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Generic, TypeVar

from pytest_libero_max.pairing.probes.probe import Column, Probe, View
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation

Memory = TypeVar("Memory")

IMAGE_SIZE = 64
"""Side of the images that a monitor is shown, pixels."""


class Monitor(Probe[tuple[Any, tuple[tuple[int, float], ...]]], Generic[Memory]):
    """Scores what a policy saw and answered, at every query. No threshold: the report calibrates it.

    The memory is an immutable value, as the state of any probe.
    """

    schema = (
        Column("step", "int", "Policy steps executed before each query", "steps", many=True, least=0),
        Column(
            "score", "float", "Score of each query, higher where it is more alarmed", many=True, along="step"
        ),
    )
    every = "query"
    cameras: ClassVar[tuple[str, ...]] = ()
    """Cameras whose images it looks at, drawn for it with 64 pixels a side."""

    @abstractmethod
    def observe(
        self, memory: Memory | None, observation: Observation, actions: Actions, step: int
    ) -> tuple[Memory, float]:
        """Return the memory for the next query and the score of this one.

        Args:
            memory: What the last query of the episode returned; None at the first.
            observation: Of the world at the query, before what a wrapper around the policy makes of it.
            actions: (n, 7) what the policy answered, Q <= n <= H.
            step: Policy steps executed before the query.
        """

    def start(self, view: View) -> tuple[Any, tuple[tuple[int, float], ...]]:
        """Return no memory and no score."""
        return None, ()

    def step(
        self, state: tuple[Any, tuple[tuple[int, float], ...]], view: View
    ) -> tuple[Any, tuple[tuple[int, float], ...]]:
        """Return the state with one more score."""
        memory, scores = state
        query = view.trajectory.queries[-1]
        observation = view.world.observe(self.cameras, IMAGE_SIZE)
        memory, score = self.observe(memory, observation, query.actions, query.step)
        return memory, (*scores, (query.step, float(score)))

    def columns(self, state: tuple[Any, tuple[tuple[int, float], ...]], view: View) -> Mapping[str, Any]:
        """Return steps and scores."""
        return {"step": [step for step, _ in state[1]], "score": [score for _, score in state[1]]}
