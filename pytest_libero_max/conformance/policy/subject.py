"""A policy as the subject of rules: what it is shown, and what it answers."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.rules import Measurements
from pytest_libero_max.conformance.substrate.subject import playable_cases
from pytest_libero_max.errors import AdapterError, LiberoMaxError
from pytest_libero_max.policies.check import Actions, ask, check_cameras, start
from pytest_libero_max.policies.contract import BatchItem, Episode, Policy, PolicySpec, Query, query_seed
from pytest_libero_max.policies.model_inputs import Inputs, marked_observation, model_inputs, read_inputs
from pytest_libero_max.worlds.contract import Observation

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.contract import ChosenSubstrate
    from pytest_libero_max.worlds.contract import World, WorldState
    from pytest_libero_max.worlds.robot import Robot

QUERIES = 4
"""Number of observations, and of queries in an episode."""

_MOVES = ((0.3, 0, 0), (0, 0.5, 0), (-0.4, 0, 0.3), (0, -0.5, -0.3))
"""Movement before each observation, four steps of each."""


@dataclass(frozen=True)
class Shown:
    """Observations and queries that a policy is examined with."""

    episode: Episode
    observations: tuple[Observation, ...]
    """:data:`QUERIES` that differ in everything, as a world gives them."""
    states: tuple[WorldState, ...] = ()
    """States of the episode's world in which they were made; empty for a policy that does not read it."""

    def copy(self, index: int) -> dict[str, NDArray[Any]]:
        """Return a copy of ``observations[index]``, which may be written to."""
        return {key: np.array(value) for key, value in self.observations[index].items()}

    def query(self, index: int) -> Query:
        """Return the query in which ``observations[index]`` is shown."""
        return Query(index, 5 * index, self.episode.instruction, query_seed(self.episode.seed, index))


def observe(policy: Policy, world: World, suite: str = "libero_spatial", task_index: int = 0) -> Shown:
    """Return observations of a world at rest and moved a little; a privileged policy gets the live world."""
    spec = policy.spec
    world.reset(0)
    observations, states = [], []
    for move in _MOVES:
        for _ in range(4):
            world.step((*move, *world.robot.noop[3:]))
        observations.append(world.observe(spec.cameras, spec.image_size))
        if spec.privileged:
            states.append(world.snapshot())
    live = world if spec.privileged else None
    episode = Episode(suite, task_index, world.language, 195, 220, live, robot=world.robot)
    return Shown(episode, tuple(observations), tuple(states))


class FirstAnswers(NamedTuple):
    """The queries of a first episode."""

    answers: tuple[Actions, ...]
    seconds: tuple[float, ...]


@dataclass
class PolicySubject(Measurements):
    """A loaded policy, what it is shown, and the answers that several rules look at."""

    policy: Policy
    shown: Shown
    loading: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of :func:`open_policy` that load it again in another process; empty where nothing does."""
    spec: PolicySpec = field(init=False)
    """Its spec before the first query."""

    def __post_init__(self) -> None:
        self.spec = replace(self.policy.spec)

    def start(self, episode: Episode | None = None) -> None:
        """Begin an episode, by default the one that is shown."""
        start(self.policy, episode or self.shown.episode)

    def ask(self, index: int, *, observation: Mapping[str, Any] | None = None, **query: Any) -> Actions:
        """Return the answer to query ``index``, some entries of whose observation and fields are replaced."""
        shown = self.shown.copy(index)
        return self.show(index, shown | dict(observation or {}), **query)

    def show(self, index: int, observation: Observation, **query: Any) -> Actions:
        """Return the answer to query ``index`` with this very observation."""
        world = self.shown.episode.world
        if world is not None:
            world.restore(self.shown.states[index])
        return ask(self.policy, observation, replace(self.shown.query(index), **query))

    def item(self, index: int) -> BatchItem:
        """Return query ``index`` as an item of a batch."""
        return BatchItem(self.shown.copy(index), self.shown.query(index), self.shown.episode)

    @property
    def robot(self) -> Robot:
        """The robot that it drives here."""
        return self.shown.episode.robot

    @property
    def first(self) -> FirstAnswers:
        """The answers to all queries of the first episode."""
        if isinstance(self._first, LiberoMaxError):
            raise self._first
        return self._first

    @cached_property
    def _first(self) -> FirstAnswers | LiberoMaxError:
        answers, seconds = [], []
        try:
            self.start()
            for index in range(QUERIES):
                began = time.perf_counter()
                answers.append(self.ask(index))
                seconds.append(time.perf_counter() - began)
        except LiberoMaxError as error:
            return error
        return FirstAnswers(tuple(answers), tuple(seconds))

    @cached_property
    def actions(self) -> Actions:
        """Every action of the first answers, (N, d)."""
        return np.concatenate(self.first.answers)

    @cached_property
    def executed(self) -> NDArray[Any]:
        """Those of them that would be executed, (N, d)."""
        return np.concatenate([answer[: self.policy.spec.query_interval] for answer in self.first.answers])

    @cached_property
    def inputs(self) -> Inputs | None:
        """Inputs of the model for a marked observation; None for a policy that does not offer them."""
        observation = marked_observation(self.shown.observations[0])
        self.start()
        arrays = model_inputs(self.policy, observation, self.shown.query(0))
        return None if arrays is None else read_inputs(arrays, observation)


def open_policy(
    reference: str,
    *,
    horizon: int | None = None,
    query_interval: int | None = None,
    profile: str | None = None,
    substrate: str = "embedded",
) -> PolicySubject:
    """Load a policy, and show it the first scene of the ``smoke`` track that it plays.

    A world that a privileged policy reads stays open as long as the process.
    """
    from pytest_libero_max.policies.loading import check_reference, load_policy
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in every process that plays: its threads change last bits
    check_reference(reference, profile, None)
    policy = load_policy(reference, horizon=horizon, query_interval=query_interval, profile=profile)
    loading = {
        "reference": reference,
        "horizon": horizon,
        "query_interval": query_interval,
        "profile": profile,
        "substrate": substrate,
    }
    return PolicySubject(policy, first_scene(policy, substrate), loading)


def first_scene(policy: Policy, substrate: str) -> Shown:
    """Return observations of the first scene that a policy plays, see :func:`.playable_cases`."""
    from pytest_libero_max.substrates.registry import chosen_substrate, open_substrate

    chosen = chosen_substrate(substrate)
    case = _first_case(policy, chosen)
    with ExitStack() as stack:
        opened = open_substrate(chosen.name, chosen.options)
        if not policy.spec.privileged:  # one that is reads the world later, too
            stack.callback(opened.close)
        world = opened.world(case)
        if policy.spec.robot not in (None, world.robot.name):
            raise AdapterError.seen(
                "robot",
                policy.spec.robot,
                f" of policy {policy.spec.name!r}, but {world.scene} has {world.robot.name!r}. Examine it on "
                "a substrate with its robot.",
            )
        check_cameras(policy, world)
        return observe(policy, world, case.suite, case.task_index)


def _first_case(policy: Policy, chosen: ChosenSubstrate) -> Case:
    """Return the first case with which a substrate is examined that the policy supports."""
    cases = playable_cases(chosen, chosen.name)
    case = next((case for case in cases if policy.spec.supports(case.suite)), None)
    if case is None:
        raise AdapterError.seen(
            "suites", policy.spec.suites, f" has no case to be examined with on {chosen.name}."
        )
    return case
