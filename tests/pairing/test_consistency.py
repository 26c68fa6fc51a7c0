"""Policies that break their contract: each is found, with the message that says how to repair it."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError, RefusalError
from pytest_libero_max.pairing.consistency import SAMPLE_INTERVAL, is_sampled
from pytest_libero_max.pairing.prefix import PrefixMode
from pytest_libero_max.pairing.runner import PairSettings, measure_pair, play_pair
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import BUDGET, Approaching, make_case

MODES: tuple[PrefixMode, ...] = ("fork", "replay")


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


class Counting(Approaching):
    """Slows down with every query it has answered: a sound policy with a memory."""

    def __init__(self) -> None:
        super().__init__(wait=9, horizon=4, interval=3)
        self.memory: dict[str, Any] = {}

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self.memory = {"answered": 0, "slow": [1.0]}

    def predict(self, observation: Any, query: Query) -> Any:
        self.memory["answered"] += 1
        self.memory["slow"].append(0.99 * self.memory["slow"][-1])
        return super().predict(observation, query) * self.memory["slow"][-1]

    def snapshot(self) -> object:
        return copy.deepcopy(self.memory)

    def restore(self, memory: Any) -> None:
        self.memory = copy.deepcopy(memory)


class WithoutRestore(Counting):
    """Its restore does nothing."""

    def restore(self, memory: Any) -> None:
        pass


class WithoutCopy(Counting):
    """Its snapshot is empty."""

    def snapshot(self) -> object:
        return {}

    def restore(self, memory: Any) -> None:
        pass


class HalfCopied(Counting):
    """Carries the count and forgets how slow it has become."""

    def snapshot(self) -> object:
        return {"answered": self.memory["answered"]}

    def restore(self, memory: Any) -> None:
        self.memory["answered"] = memory["answered"]


class LateHalf(HalfCopied):
    """What it forgets to carry matters after five queries only, well after the event."""

    def predict(self, observation: Any, query: Query) -> Any:
        chunk = super().predict(observation, query) / self.memory["slow"][-1]
        return chunk * (0.5 if len(self.memory["slow"]) > 5 else 1.0)


class Live(Counting):
    """Hands out what it goes on writing to, wrapped in something that no pickle is made of."""

    def snapshot(self) -> object:
        memory = self.memory
        return lambda: memory

    def restore(self, memory: Any) -> None:
        self.memory = memory()


class Adopted(Live):
    """Copies, but takes the copy for its own when it is restored."""

    def snapshot(self) -> object:
        memory = copy.deepcopy(self.memory)
        return lambda: memory


DIFFERENTLY = (
    r"policy 'approaching' answered query \d+ at step \d+ differently when it was shown the same observation "
    r"again, with the memory that it had before. Let snapshot\(\) copy all that answers depend on"
)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", [WithoutRestore, WithoutCopy, HalfCopied, LateHalf, Live, Adopted])
def test_a_memory_that_is_not_carried_is_found(world: TinyWorld, kind: type[Counting], mode: Any) -> None:
    with pytest.raises(AdapterError, match=DIFFERENTLY):
        play_pair(make_case(), world, kind(), PairSettings(mode))


def test_a_sound_memory_is_what_it_was_before_it_was_asked_again(world: TinyWorld) -> None:
    policies = {mode: Counting() for mode in MODES}
    fork, replay = (measure_pair(make_case(), world, policies[mode], PairSettings(mode)) for mode in MODES)
    assert fork.record.triggered
    assert fork.record.identity() == replay.record.identity()
    queries = fork.record.base_queries + fork.record.dynamic_queries
    assert len(policies["fork"].queries) == queries + 3  # before the event, and late in either arm
    before = len(replay.base.queries) - fork.record.dynamic_queries
    assert len(policies["replay"].queries) == queries + before + 3


class Hidden(Approaching):
    """Has a memory that nobody can copy, and that matters after ``late`` queries only."""

    late = 9

    def __init__(self) -> None:
        super().__init__(wait=9, horizon=4, interval=3)

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self.answered = 0

    def predict(self, observation: Any, query: Query) -> Any:
        self.answered += 1
        return super().predict(observation, query) * (0.5 if self.answered > self.late else 1.0)


@pytest.mark.parametrize("late", [0, 2, 4, 6])
def test_a_hidden_memory_gives_no_other_record_in_fork_than_in_replay(world: TinyWorld, late: int) -> None:
    policy = Hidden()
    policy.late = late
    replay = play_pair(make_case(), world, policy, PairSettings("replay"))
    assert replay.triggered
    if late > replay.base_queries or late == 0:
        assert play_pair(make_case(), world, policy).identity() == replay.identity()
        return
    with pytest.raises(RefusalError, match=r"snapshot\(\)"):
        play_pair(make_case(), world, policy)


def test_a_query_is_asked_again_also_where_nothing_happens(world: TinyWorld) -> None:
    policy = WithoutRestore()
    policy.wait = BUDGET
    with pytest.raises(AdapterError, match="query 7 at step 21"):
        play_pair(make_case(), world, policy)


def test_a_world_that_is_altered_behind_the_contract_is_noticed(world: TinyWorld) -> None:
    class Finder(Approaching):
        """Finds the world that it is not given, as one could in the frames of its callers."""

        def predict(self, observation: Any, query: Query) -> Any:
            world.data.qvel[0] += 1e-3
            return super().predict(observation, query)

    with pytest.raises(AdapterError, match="altered while policy 'approaching'"):
        play_pair(make_case(), world, Finder())


def test_the_sampled_queries_differ_from_case_to_case() -> None:
    first = {next(i for i in range(SAMPLE_INTERVAL) if is_sampled(i, f"case-{n}")) for n in range(40)}
    assert first == set(range(SAMPLE_INTERVAL))


def test_a_policy_that_says_it_does_not_repeat_itself_is_not_asked_again(world: TinyWorld) -> None:
    policy = WithoutRestore()
    policy.spec = replace(policy.spec, repeatable=False)
    for mode in MODES:
        policy.queries.clear()
        record = play_pair(make_case(), world, policy, PairSettings(mode))
        assert len(policy.queries) == record.base_queries + record.dynamic_queries


# The spec and the query.


class Growing(Approaching):
    """Asks for fewer queries as soon as nobody looks."""

    where = "reset"

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        if self.where == "reset":
            self.spec = replace(self.spec, horizon=8)

    def predict(self, observation: Any, query: Query) -> Any:
        if self.where == "predict" and query.index == 2:
            object.__setattr__(self.spec, "cameras", ("agentview",))  # in place
        return super().predict(observation, query)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("reset", "changed its spec in reset: horizon=1 became 8. The spec is part of every result"),
        ("predict", r"changed its spec in predict, query 2 at step 2: cameras=\(\) became \('agentview',\)"),
    ],
)
def test_a_spec_that_changes_is_an_error(world: TinyWorld, where: str, message: str) -> None:
    policy = Growing()
    policy.where = where
    with pytest.raises(AdapterError, match=f"policy 'approaching' {message}"):
        play_pair(make_case(), world, policy)


def test_what_a_policy_writes_into_a_query_alters_nothing(world: TinyWorld) -> None:
    class Scribbling(Approaching):
        def predict(self, observation: Any, query: Query) -> Any:
            chunk = super().predict(observation, query)
            self.queries[-1] = replace(query)
            for name, value in (("index", 99), ("step", 12345), ("instruction", "lie"), ("seed", 0)):
                object.__setattr__(query, name, value)
            self.returned = chunk
            return chunk

    scribbling, honest = (kind(wait=3, horizon=4, interval=4) for kind in (Scribbling, Approaching))
    for mode in MODES:
        pairs = [
            measure_pair(make_case(), world, policy, PairSettings(mode)) for policy in (scribbling, honest)
        ]
        assert pairs[0].record.identity() == pairs[1].record.identity()
        for one, other in zip(pairs[0].base.queries, pairs[1].base.queries, strict=True):
            assert (one.index, one.step) == (other.index, other.step)
    assert scribbling.queries == honest.queries


def test_what_a_policy_does_with_its_actions_later_alters_nothing(world: TinyWorld) -> None:
    class Reusing(Approaching):
        """Returns one and the same array every time."""

        def __init__(self) -> None:
            super().__init__(wait=3, horizon=4, interval=4)
            self.chunk = np.zeros((4, 7))

        def predict(self, observation: Any, query: Query) -> Any:
            self.chunk[:] = super().predict(observation, query)
            return self.chunk

    reusing = play_pair(make_case(), world, Reusing())
    assert reusing.identity() == play_pair(make_case(), world, Approaching(3, 4, 4)).identity()
