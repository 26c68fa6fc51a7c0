from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.changes import MoveObject, Nothing, SetInstruction
from pytest_libero_max.errors import ActionError, AdapterError, EntityError, ProtocolError, SimulatorError
from pytest_libero_max.events.schedules import Arm, Entry, Revert
from pytest_libero_max.events.triggers import Proximity, StepsAfter
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import (
    PairSettings,
    continue_rollout,
    inject,
    measure_pair,
    play_pair,
    play_prefix,
    return_to,
)
from pytest_libero_max.policies.contract import Episode, Query, query_seed
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import alterable, on_mujoco
from pytest_libero_max.worlds.robot import CAMERAS

from .actors import BUDGET, Approaching, Looking, Posing, Solvable, make_case, policy_steps, shorten

BOTH = (PairSettings("fork"), PairSettings("replay"))


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def crossing_case(world: TinyWorld, wait: int, step: int) -> Case:
    """A case whose trigger distance ``Approaching(wait)`` first undercuts after ``step`` policy steps."""
    path = measure_pair(make_case(distance_m=1e-9), world, Approaching(wait, BUDGET, BUDGET)).base
    distances = np.linalg.norm(path.end_effector - path.entity, axis=1)
    assert step == 1 or distances[step - 1] < distances[: step - 1].min()
    return make_case(distance_m=float(distances[step - 1]) + 1e-12)


# Both ways to the event.


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    case=strategies.cases(
        events=strategies.events(distances_m=st.sampled_from([0.25, 0.45, 0.6])), suites=["libero_spatial"]
    ),
    policy=strategies.scripted_policies(drift=(0.35, 0.53, -0.77)),
)
def test_fork_and_replay_measure_the_same_pair(world: TinyWorld, case: Case, policy: Any) -> None:
    case = shorten(case)
    fork, replay = (measure_pair(case, world, policy, how) for how in BOTH)
    assert fork.record.identity() == replay.record.identity()
    assert PairRecord.from_dict(json.loads(json.dumps(fork.record.to_dict(), allow_nan=False))) == fork.record
    event(f"triggered: {fork.record.triggered}")
    if fork.dynamic is None:
        assert fork.record.dynamic_success == fork.record.base_success
        return
    shared = fork.record.trigger_step
    assert fork.base.actions[:shared].tobytes() == fork.dynamic.actions[:shared].tobytes()
    assert fork.base.end_effector[:shared].tobytes() == fork.dynamic.end_effector[:shared].tobytes()
    assert fork.record.dynamic_digest != fork.record.base_digest


def test_fork_and_replay_measure_the_same_pair_under_absolute_control(world: TinyWorld) -> None:
    case = make_case("target_relocation", distance_m=0.15)
    fork, replay = (measure_pair(case, world, Posing(8, 5), how) for how in BOTH)
    assert fork.record.identity() == replay.record.identity()
    assert fork.record.trigger_step is not None
    assert fork.record.policy["control"] == "absolute"
    assert PairRecord.from_dict(fork.record.to_dict()) == fork.record
    assert np.linalg.norm(fork.base.end_effector[-1] - [0.1, -0.1, 0.5]) < 0.05
    assert fork.record.arms["base"].clipped_components == fork.base.steps  # the gripper's alone
    assert world.snapshot().control == "absolute"
    movements = play_pair(case, world, Approaching())
    assert world.snapshot().control == "delta"
    assert "control" not in movements.policy


def test_the_pieces_play_under_the_control_of_the_policy(world: TinyWorld) -> None:
    case, policy = make_case("target_relocation", distance_m=0.15), Posing(8, 5)
    pair = measure_pair(case, world, policy)
    branch = play_prefix(case, world, policy)
    assert branch is not None
    assert pair.dynamic is not None
    world.reset(0)
    return_to(branch, case, world, policy)
    inject(case, world)
    assert continue_rollout(branch, case, world, policy).proof == pair.dynamic.proof


def test_a_pair_does_not_depend_on_what_its_world_played_before(world: TinyWorld) -> None:
    policy = Approaching(wait=3, horizon=10, interval=10, cameras=CAMERAS)
    case = make_case("sensor_noise_onset")
    used = play_pair(case, world, policy)
    again = play_pair(case, world, policy)
    fresh_world = TinyWorld()
    fresh = play_pair(case, fresh_world, policy)
    fresh_world.close()
    assert used.triggered
    assert used.identity() == again.identity() == fresh.identity()
    assert used.timings != again.timings


# The trigger.


def test_the_event_fires_after_the_first_step_within_the_distance(world: TinyWorld) -> None:
    pair = measure_pair(make_case(distance_m=0.18), world, Approaching(wait=4))
    distances = np.linalg.norm(pair.base.end_effector - pair.base.entity, axis=1)
    first = int(np.argmax(distances <= 0.18)) + 1
    assert pair.record.trigger_step == first > 4
    assert pair.record.trigger_distance_m == pytest.approx(distances[first - 1])
    assert pair.record.min_distance_m == pytest.approx(distances.min())


@pytest.mark.parametrize("how", BOTH, ids=["fork", "replay"])
def test_an_event_that_never_fires_leaves_one_rollout(world: TinyWorld, how: PairSettings) -> None:
    policy = Approaching(wait=BUDGET)
    record = play_pair(make_case(), world, policy, how)
    assert not record.triggered
    assert (record.trigger_distance_m, record.response_step, record.stale_actions) == (None, None, None)
    assert (record.prefix_digest, record.dynamic_digest, record.evidence) == (None, None, None)
    assert (record.dynamic_success, record.dynamic_steps) == (record.base_success, record.base_steps)
    assert record.dynamic_queries == 0
    again = how.prefix == "fork"  # the last query, to see that the policy repeats itself
    assert record.base_steps == BUDGET == len(policy.queries) - again
    assert len(policy.episodes) == 1 + again


def _later(step: int, world: TinyWorld) -> bool:
    return policy_steps(world) >= step


def test_an_episode_that_is_solved_has_no_event_any_more() -> None:
    policy = Approaching()
    probe = Solvable()
    case = make_case()
    crossing = play_pair(case, probe, policy).trigger_step
    assert crossing is not None
    for solved_at, triggered in ((crossing - 1, False), (crossing, False), (crossing + 1, True)):
        world = Solvable(partial(_later, solved_at))
        record = play_pair(case, world, policy)
        assert record.triggered == triggered
        assert record.base_success
        assert record.base_steps == solved_at


@pytest.mark.parametrize(("step", "triggered"), [(BUDGET - 1, True), (BUDGET, False)])
def test_an_event_needs_a_step_to_happen_before(world: TinyWorld, step: int, triggered: bool) -> None:
    policy = Approaching(wait=BUDGET - 3, horizon=4, interval=4)
    record = play_pair(crossing_case(world, policy.wait, step), world, policy)
    assert record.triggered == triggered
    if triggered:
        assert (record.trigger_step, record.dynamic_steps) == (BUDGET - 1, BUDGET)
        # The last action was queued at step 46: no query could follow.
        assert (record.response_step, record.stale_actions, record.dynamic_queries) == (None, 1, 0)


# The event.


@pytest.mark.parametrize("how", BOTH, ids=["fork", "replay"])
def test_the_event_happens_once_and_stays(world: TinyWorld, how: PairSettings) -> None:
    record = play_pair(make_case("sensor_noise_onset"), world, Approaching(), how)
    assert record.trigger_step is not None
    assert [since for _, since in world.filters] == [10 + record.trigger_step]
    pair = measure_pair(make_case("target_relocation"), world, Approaching(), how)
    assert pair.dynamic is not None
    moved = pair.dynamic.entity - pair.base.entity
    at = pair.record.trigger_step
    assert not moved[:at].any()
    assert moved[at, 0] == pytest.approx(0.05, abs=1e-3)
    assert (moved[at:, 0] > 0.02).all()  # the hand pushes the boxes about a little


def test_an_event_that_alters_nothing_is_no_event(world: TinyWorld) -> None:
    case = make_case("target_relocation")
    still = MoveObject("cabinet_1", (0.0, 0.0, 0.0))
    idle = replace(case, event=replace(case.event, change=still.to_dict()))
    with pytest.raises(ProtocolError, match="move_object"):
        play_pair(idle, world, Approaching())
    nothing = replace(case, event=replace(case.event, change=Nothing().to_dict()))
    record = play_pair(nothing, world, Approaching())
    assert record.dynamic_digest == record.base_digest


def test_the_setup_is_shared_and_the_trigger_entity_must_exist(world: TinyWorld) -> None:
    case = make_case()
    parked = {"operation": "remove_object", "object": "clutter_1", "offworld_position_m": [-2, 0, -5]}
    record = play_pair(replace(case, event=replace(case.event, setup=(parked,))), world, Approaching())
    assert record.triggered
    assert world.parked == ("clutter_1",)
    lost = replace(case, event=replace(case.event, trigger={**case.event.trigger, "value": "box_2"}))
    with pytest.raises(EntityError, match="box_1"):
        play_pair(lost, world, Approaching())


# Stale actions and queries.


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    serving=st.integers(1, 12).flatmap(lambda h: st.tuples(st.just(h), st.integers(1, h))),
    extra=st.integers(0, 11),
    step=st.integers(1, 4),
    wait=st.integers(0, 16),
)
def test_stale_actions_are_those_that_a_plain_simulation_counts(
    world: TinyWorld, serving: tuple[int, int], extra: int, step: int, wait: int
) -> None:
    horizon, interval = serving
    policy = Approaching(wait, horizon, interval, length=min(horizon, interval + extra))
    case = make_case(distance_m=0.284 - 0.02 * step)  # crossed some steps after the hand sets out
    record = play_pair(case, world, policy)
    assert record.trigger_step is not None
    queue, stale, response = 0, 0, None
    for executed in range(case.budget):
        if queue == 0:
            queue = interval
            if executed >= record.trigger_step and response is None:
                response = executed
        queue -= 1
        if executed >= record.trigger_step and response is None:
            stale += 1
    assert (record.stale_actions, record.response_step) == (stale, response)
    assert record.base_queries == -(-case.budget // interval)
    assert record.dynamic_queries == sum(q >= record.trigger_step for q in range(0, case.budget, interval))


def test_the_queries_of_dynamic_continue_those_of_the_prefix(world: TinyWorld) -> None:
    policy = Approaching(wait=7, horizon=6, interval=4)
    policy.spec = replace(policy.spec, repeatable=False)  # so that no query is asked twice
    pair = measure_pair(make_case(), world, policy)
    base, dynamic = policy.queries[: pair.record.base_queries], policy.queries[pair.record.base_queries :]
    assert [query.index for query in base] == list(range(len(base)))
    assert [query.step for query in base] == list(range(0, BUDGET, 4))
    assert dynamic == base[-len(dynamic) :]
    assert dynamic[0].step == pair.record.response_step
    assert all(query.seed == query_seed(195, query.index) for query in policy.queries)
    assert {query.instruction for query in policy.queries} == {world.language}


def test_stale_actions_come_from_before_the_event_and_the_next_query_sees_it(world: TinyWorld) -> None:
    policy = Approaching(wait=2, horizon=8, interval=8, cameras=CAMERAS)
    pair = measure_pair(make_case("camera_shift"), world, policy)
    record, dynamic = pair.record, pair.dynamic
    assert dynamic is not None
    assert record.trigger_step is not None
    assert record.stale_actions
    assert record.evidence is not None
    shared = record.trigger_step + record.stale_actions
    assert pair.base.actions[:shared].tobytes() == dynamic.actions[:shared].tobytes()
    assert len(dynamic.queries) * 8 >= dynamic.steps
    first_after = policy.views[len(policy.views) - record.dynamic_queries - 1]  # the last one is asked again
    in_base = policy.views[record.base_queries - record.dynamic_queries]
    # A camera shift moves no body: the same moment, seen from another place.
    assert np.abs(first_after.astype(int) - in_base).mean() > 1.0
    assert record.evidence["pixel_change"]["agentview"] > 1.0
    assert record.evidence["pixel_change"]["robot0_eye_in_hand"] == 0.0


# What a policy is told and shown.


def test_a_policy_learns_the_case_and_no_more(world: TinyWorld) -> None:
    policy = Approaching()
    case = make_case(instruction="do it")
    record = play_pair(case, world, policy)
    expected = Episode("libero_spatial", 0, "do it", 195, BUDGET, robot=world.robot)
    assert policy.episodes == [expected] * 4  # two arms, and a late query of each asked again
    assert record.instruction == "do it"
    privileged = Approaching(privileged=True)
    play_pair(case, world, privileged)
    assert [episode.world for episode in privileged.episodes] == [world] * 4


def test_an_instruction_that_changes_in_the_middle_replaces_the_manifests(world: TinyWorld) -> None:
    new = Entry(Proximity("box_1"), SetInstruction("leave it"))
    back = Entry(StepsAfter(4), Revert(0))
    case = make_case(instruction="do it")
    for mode in ("fork", "replay"):
        policy = Approaching(horizon=2, interval=2)
        arms = (Arm("base"), Arm("dynamic", (new, back)))
        record = play_pair(case, world, policy, PairSettings(mode), arms=arms)
        firing = record.arms["dynamic"].firings[0]
        told = [query.instruction for query in policy.queries if firing.step < query.step <= firing.step + 4]
        assert record.instruction == "do it"
        assert {"do it", "leave it"} == set(told)  # Base, and Dynamic until the words are taken back
        late = {query.instruction for query in policy.queries if query.step > firing.step + 4}
        assert late == {"do it"}
    branch = play_prefix(case, world, policy)
    assert branch is not None
    asked = len(policy.queries)
    SetInstruction("stack it").apply(world)
    continue_rollout(branch, case, world, policy)
    assert {query.instruction for query in policy.queries[asked:]} == {"stack it"}


@pytest.mark.parametrize("how", BOTH, ids=["fork", "replay"])
def test_nothing_is_rendered_for_a_policy_that_does_not_look(how: PairSettings) -> None:
    world = Looking()
    record = play_pair(make_case(), world, Approaching(), how)
    assert record.evidence is not None
    assert world.images == 0
    assert record.evidence["pixel_change"] == {}


def test_images_are_rendered_for_queries_and_evidence_alone() -> None:
    world = Looking()
    policy = Approaching(wait=10, horizon=5, interval=5, cameras=("agentview",))
    record = play_pair(make_case(), world, policy)
    asked_again, before_and_after = 3, 2
    assert len(policy.queries) == record.base_queries + record.dynamic_queries + asked_again
    assert world.images == len(policy.queries) - asked_again + before_and_after, "a state was drawn twice"
    assert policy.views[0].shape == (32, 32, 3)
    world.close()


# The record.


def test_a_record_survives_json_and_says_what_was_played(world: TinyWorld) -> None:
    policy = Approaching(horizon=10, interval=10, cameras=CAMERAS)
    record = play_pair(
        make_case(), world, policy, PairSettings(fingerprints={"substrate": "tiny"}), lambda phase: None
    )
    assert PairRecord.from_dict(json.loads(json.dumps(record.to_dict(), allow_nan=False))) == record
    assert record.policy == policy.spec.to_dict()
    assert record.fingerprints == {"substrate": "tiny"}
    assert record.evidence is not None
    assert record.evidence["operation"] == "shift_camera"
    assert record.evidence["before"] != record.evidence["after"]
    phases = {"reset_s", "arm_base_s", "prefix_s", "event_s", "arm_dynamic_s"}
    assert set(record.timings) == {*phases, "policy_s", "observe_s", "asked_again_s", "query_ms"}
    assert all(seconds >= 0.0 for name, seconds in record.timings.items() if name != "query_ms")


def test_contacts_are_those_of_the_end(world: TinyWorld) -> None:
    record = play_pair(make_case(), world, Approaching(wait=BUDGET))
    assert record.contacts == {"base": ["main_table"], "dynamic": ["main_table"]}


# The pieces.


def test_the_pieces_add_up_to_the_pair(world: TinyWorld) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=3, horizon=4, interval=4)
    branch = play_prefix(case, world, policy)
    assert branch is not None
    assert world.digest() == branch.digest
    evidence = inject(case, world)
    result = continue_rollout(branch, case, world, policy)
    pair = measure_pair(case, world, policy)
    assert pair.dynamic is not None
    assert result.proof == pair.dynamic.proof == pair.record.dynamic_digest
    assert branch.proof == pair.record.prefix_digest
    assert evidence == pair.record.evidence
    assert play_prefix(case, world, Approaching(wait=BUDGET)) is None


# What goes wrong.


class Failing(Approaching):
    """Fails at query 3."""

    error: BaseException = ValueError("no such tensor")

    def predict(self, observation: Any, query: Query) -> Any:
        if query.index == 3:
            raise self.error
        return super().predict(observation, query)


def test_a_policy_that_raises_is_an_error_that_says_where(world: TinyWorld) -> None:
    phases: list[str] = []
    with pytest.raises(AdapterError) as caught:
        play_pair(make_case(), world, Failing(horizon=2, interval=2), on_phase=phases.append)
    seen = (
        "'approaching'",
        "ValueError in predict, query 3 at step 6",
        "test_runner.py, line",
        "no such tensor",
    )
    assert all(words in str(caught.value) for words in seen)
    assert isinstance(caught.value.__cause__, ValueError)
    assert phases == ["setup", "base"]


def test_an_interrupt_passes(world: TinyWorld) -> None:
    policy = Failing()
    policy.error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        play_pair(make_case(), world, policy)


def test_phases_are_told_as_they_begin(world: TinyWorld) -> None:
    phases: list[str] = []
    play_pair(make_case(), world, Approaching(), on_phase=phases.append)
    assert phases == ["setup", "base", "dynamic"]
    phases.clear()
    play_pair(make_case(), world, Approaching(wait=BUDGET), on_phase=phases.append)
    assert phases == ["setup", "base"]


def test_actions_that_cannot_be_played_name_their_query(world: TinyWorld) -> None:
    class Short(Approaching):
        def predict(self, observation: Any, query: Query) -> Any:
            return np.zeros((1 if query.index else 2, 7))

    with pytest.raises(ActionError, match=r"^query 1 at step 2: .*\b1\b"):
        play_pair(make_case(), world, Short(horizon=2, interval=2))


@pytest.mark.parametrize("where", ["reset", "predict, query 0 at step 0"])
def test_a_policy_that_writes_to_the_world_is_caught(world: TinyWorld, where: str) -> None:
    class Cheating(Approaching):
        def reset(self, episode: Episode) -> None:
            super().reset(episode)
            assert episode.world is not None
            self.world = alterable(episode.world)
            if where == "reset":
                alterable(episode.world).place("box_1", (0.1, 0.15, 0.46))

        def predict(self, observation: Any, query: Query) -> Any:
            on_mujoco(self.world).data.qpos[0] += 1e-9
            return super().predict(observation, query)

    with pytest.raises(AdapterError, match=f"altered .* in {where}, "):
        play_pair(make_case(), world, Cheating(privileged=True))


def test_a_broken_simulation_is_not_the_policys_failure() -> None:
    class Exploding(TinyWorld):
        def step(self, action: Any) -> None:
            super().step(action)
            if policy_steps(self) == 5:
                self.data.qvel[0] = np.nan
                super().step(action)

    with pytest.raises(SimulatorError, match="no longer finite"):
        play_pair(make_case(), Exploding(), Approaching())
