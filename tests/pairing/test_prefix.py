from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import AdapterError, ProtocolError, RefusalError
from pytest_libero_max.pairing.prefix import PrefixMode
from pytest_libero_max.pairing.runner import (
    PairSettings,
    continue_rollout,
    inject,
    play_pair,
    play_prefix,
    return_to,
)
from pytest_libero_max.pairing.trajectory import event_link, first_link, next_link
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.strategies import RememberingPolicy
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import WorldState

from .actors import Approaching, make_case, policy_steps, shorten

MODES: tuple[PrefixMode, ...] = ("fork", "replay")


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def test_a_link_depends_on_everything_before_it() -> None:
    zero, other = bytes(32), bytes(31) + b"\x01"
    action, nudged = np.zeros(7), np.array([0, 0, 0, 0, 0, 0, 5e-324])
    links = [
        first_link(zero),
        first_link(other),
        next_link(zero, action, zero),
        next_link(other, action, zero),
        next_link(zero, nudged, zero),
        next_link(zero, action, other),
        event_link(zero, zero),
        event_link(zero, other),
    ]
    assert len(set(links)) == len(links)
    assert {len(link) for link in links} == {32}


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    case=strategies.cases(
        events=strategies.events(distances_m=st.sampled_from([0.25, 0.45, 0.6])), suites=["libero_spatial"]
    ),
    policy=strategies.scripted_policies(drift=(0.35, 0.53, -0.77)),
    mode=st.sampled_from(MODES),
)
def test_without_the_event_the_continuation_is_base(
    world: TinyWorld, case: Case, policy: Any, mode: Any
) -> None:
    case = shorten(case)
    branch = play_prefix(case, world, policy)
    assume(branch is not None)
    assert branch is not None
    base = continue_rollout(branch, case, world, policy)
    world.reset(0)
    return_to(branch, case, world, policy, mode)
    assert world.digest() == branch.digest
    again = continue_rollout(branch, case, world, policy)
    assert again.proof == base.proof
    assert again.actions.tobytes() == base.actions.tobytes()
    assert (again.success, again.probes) == (base.success, base.probes)


def test_a_branch_point_can_be_returned_to_again_and_again(world: TinyWorld) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=2, horizon=5, interval=3)
    branch = play_prefix(case, world, policy)
    assert branch is not None
    proofs = set()
    for mode in MODES * 2:
        return_to(branch, case, world, policy, mode)
        inject(case, world)
        proofs.add(continue_rollout(branch, case, world, policy).proof)
    assert len(proofs) == 1
    assert branch.step == len(branch.trajectory.executed) == len(branch.trajectory.actions)
    assert len(branch.trajectory.pending) == branch.trajectory.queued == -branch.step % 3


# Worlds that do not repeat themselves.


class Forgetful(TinyWorld):
    """Leaves the fingers' controller out of its snapshots."""

    def restore(self, state: WorldState) -> None:
        super().restore(state)
        self._set_controller_state(np.array([0.125]))


class Drifting(TinyWorld):
    """Steps differently from the second reset on, after ``at`` policy steps."""

    at = 0
    resets = -2  # one is played by the constructor, one by Base

    def reset(self, init: int) -> None:
        super().reset(init)
        self.resets += 1
        if self.resets and not self.at:
            self.data.qvel[0] += 1e-15

    def step(self, action: Any) -> None:
        super().step(action)
        if self.resets and self.at and policy_steps(self) == self.at:
            self.data.qvel[0] += 1e-15


def test_a_snapshot_that_leaves_something_out_is_caught() -> None:
    settings = PairSettings("fork")
    with pytest.raises(ProtocolError, match=r"snapshot at step 2\d"):
        play_pair(make_case(distance_m=0.3), Forgetful(), Approaching(), settings)


@pytest.mark.parametrize(
    ("at", "where"), [(0, "before the first step"), (1, "after step 1 of 4"), (4, "after step 4 of 4")]
)
def test_a_simulation_that_does_not_repeat_itself_is_caught_where_it_differs(at: int, where: str) -> None:
    world = Drifting()
    world.at = at
    branch = play_prefix(make_case(distance_m=0.18), TinyWorld(), Approaching())
    assert branch is not None
    assert branch.step == 4
    with pytest.raises(ProtocolError, match=f"differs {where} from"):
        play_pair(make_case(), world, Approaching(), PairSettings("replay"))


# Policies that remember, and policies that do not repeat themselves.


def remembering(kind: type[RememberingPolicy] = RememberingPolicy) -> RememberingPolicy:
    spec = PolicySpec("remembering", 3, 2, (), 32)
    return kind(spec, [(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0)], 3, (0.35, 0.53, -0.77))


class WithoutSnapshot(RememberingPolicy):
    """Remembers, but its memory cannot be copied."""

    def __getattribute__(self, name: str) -> Any:
        if name in ("snapshot", "restore"):
            raise AttributeError(name)
        return super().__getattribute__(name)


class Unseeded(Approaching):
    """Draws from something that is not the query."""

    draws = 0

    def predict(self, observation: Any, query: Query) -> Any:
        self.draws += 1
        return super().predict(observation, query) - 1e-3 * self.draws * np.eye(7)[2]


def test_memory_is_restored_through_its_own_snapshot(world: TinyWorld) -> None:
    fork, replay = (play_pair(make_case(), world, remembering(), PairSettings(mode)) for mode in MODES)
    assert fork.trigger_step is not None
    assert fork.trigger_step > 2
    assert fork.identity() == replay.identity()


class Aliasing(RememberingPolicy):
    """Hands out its living memory, or takes a copy for its own."""

    hands_out = True

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self.seen: list[int] = []

    def predict(self, observation: Any, query: Query) -> Any:
        self.seen.append(query.index)
        return super().predict(observation, query)

    def snapshot(self) -> object:
        return self._memory, self.seen if self.hands_out else list(self.seen)

    def restore(self, memory: Any) -> None:
        self._memory, self.seen = memory


def test_a_snapshot_that_is_no_copy_is_caught(world: TinyWorld) -> None:
    policy = remembering(Aliasing)
    with pytest.raises(AdapterError, match=r"'remembering' .* at step \d+"):
        play_pair(make_case(), world, policy)


@pytest.mark.parametrize("mode", MODES)
def test_a_restore_that_takes_the_copy_for_its_own_is_caught(world: TinyWorld, mode: Any) -> None:
    policy = remembering(Aliasing)
    policy.hands_out = False  # type: ignore[attr-defined]
    with pytest.raises(AdapterError, match="has changed since"):
        play_pair(make_case(), world, policy, PairSettings(mode))


def test_a_memory_that_cannot_be_pickled_is_taken_as_it_is(world: TinyWorld) -> None:
    class Closure(RememberingPolicy):
        def snapshot(self) -> object:
            memory = self._memory
            return lambda: memory

        def restore(self, memory: Any) -> None:
            self._memory = memory()

    assert play_pair(make_case(), world, remembering(Closure)).identity() == (
        play_pair(make_case(), world, remembering()).identity()
    )


def test_memory_without_a_snapshot_needs_the_whole_replay(world: TinyWorld) -> None:
    with_snapshot = play_pair(make_case(), world, remembering())
    shown_again = play_pair(make_case(), world, remembering(WithoutSnapshot), PairSettings("replay"))
    assert shown_again.identity()["arms"] == with_snapshot.identity()["arms"]
    with pytest.raises(RefusalError) as caught:
        play_pair(make_case(), world, remembering(WithoutSnapshot), PairSettings("fork"))
    assert all(words in str(caught.value) for words in ("'remembering'", "snapshot()", "restore(memory)"))


@pytest.mark.parametrize("mode", MODES)
def test_a_policy_that_does_not_repeat_itself_is_caught_unless_it_says_so(
    world: TinyWorld, mode: Any
) -> None:
    with pytest.raises(RefusalError, match=r"query\.seed"):
        play_pair(make_case(), world, Unseeded(), PairSettings(mode))
    honest = Unseeded()
    honest.spec = PolicySpec("honest", cameras=(), repeatable=False)
    record = play_pair(make_case(), world, honest, PairSettings(mode))
    assert record.triggered
    assert record.policy["repeatable"] is False


def test_replay_shows_a_policy_without_snapshot_what_it_saw(world: TinyWorld) -> None:
    policy = Approaching(wait=5, horizon=4, interval=3, cameras=("agentview",))
    record = play_pair(make_case(), world, policy, PairSettings("replay"))
    assert record.trigger_step is not None
    shown = -(-record.trigger_step // 3)
    again = slice(record.base_queries, record.base_queries + shown)
    assert policy.queries[again] == policy.queries[:shown]
    for first, second in zip(policy.views[:shown], policy.views[again], strict=True):
        assert first.tobytes() == second.tobytes()
    assert len(policy.queries) == record.base_queries + shown + record.dynamic_queries


def test_a_privileged_policy_is_asked_again_in_the_world_it_was_asked_in(world: TinyWorld) -> None:
    class Homing(Approaching):
        """Heads for the box from where the live world says the hand is."""

        def reset(self, episode: Episode) -> None:
            super().reset(episode)
            assert episode.world is not None
            self.world = episode.world

        def predict(self, observation: Any, query: Query) -> Any:
            assert np.array_equal(observation["robot0_eef_pos"], self.world.end_effector())
            action = np.append(self.world.position("box_1") - self.world.end_effector(), [0, 0, 0, -1])
            return np.tile(5 * action, (self.spec.horizon, 1)).clip(-1, 1)

    fork, replay = (
        play_pair(
            make_case("target_relocation"),
            world,
            Homing(horizon=4, interval=4, privileged=True),
            PairSettings(mode),
        )
        for mode in MODES
    )
    assert fork.triggered
    assert fork.identity() == replay.identity()
