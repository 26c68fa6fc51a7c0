"""Pairs whose queries take time, played on the tiny world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.changes import DelayAnswers
from pytest_libero_max.errors import AdapterError, ReportError
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of
from pytest_libero_max.events.triggers import Proximity, StepsAfter
from pytest_libero_max.pairing.environment import ArmEnv
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import (
    Pair,
    PairSettings,
    continue_rollout,
    inject,
    measure_pair,
    play_prefix,
)
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.robot import NOOP_ACTION

from .actors import BUDGET, Approaching, Posing, make_case

QUIET = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def late(case: object, latency: Latency) -> tuple[Arm, ...]:
    return tuple(replace(arm, latency=latency) for arm in arms_of(case))  # type: ignore[arg-type]


def play(world: TinyWorld, policy: Approaching, latency: Latency, prefix: str = "fork") -> Pair:
    case = make_case("target_relocation", distance_m=0.25)
    return measure_pair(case, world, policy, PairSettings(prefix), arms=late(case, latency))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "hz", "latency"),
    [
        ("4steps", None, Latency(4)),
        ("4steps,sync", None, Latency(4, "sync")),
        ("4steps,async", None, Latency(4)),
        ("0steps,sync", None, NO_LATENCY),
        ("1ms", 20, Latency(1)),
        ("50ms", 20, Latency(1)),
        ("51ms", 20, Latency(2)),
        ("200ms,sync", 20, Latency(4, "sync")),
        ("1:80+12:20steps", 20, Latency(12, "async", ((1, 80), (12, 20)))),
        ("1:80+12:20steps,sync", None, Latency(12, "sync", ((1, 80), (12, 20)))),
        ("3:80steps", None, Latency(3)),
    ],
)
def test_a_latency_is_read_and_rounded_up(text: str, hz: int | None, latency: Latency) -> None:
    assert Latency.parse(text, hz) == latency
    if latency.steps:
        assert Latency.parse(str(latency)) == latency


@pytest.mark.parametrize(
    "text",
    [
        *("4", "4 steps", "-1steps", "1.5steps", "4steps,late", "50000ms", "1000steps", "4ms"),
        *("0:1+1:1steps", "2:1+1:1steps", "1:1+1:1steps", "1:0steps"),
        *("1:1+steps", "1:1+2:1steps,late", "40:1+80:1ms"),
    ],
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        Latency.parse(text, None if text == "4ms" else 20)


def test_the_delays_of_a_latency_of_recorded_times_are_drawn_in_their_proportions() -> None:
    assert Latency.of_times({40.0: 3, 0.0: 1, 50.0: 1}, 20) == Latency(1)
    latency = Latency.of_times({40.0: 700, 51.0: 200, 1e6: 99, 99.0: 1}, 20, "sync")
    assert str(latency) == "1:700+2:201+999:99steps,sync"
    drawn = [latency.drawn_for("case a").delay(index) for index in range(5000)]
    assert drawn == [latency.drawn_for("case a").delay(index) for index in range(5000)]
    assert drawn[:50] != [latency.drawn_for("case b").delay(index) for index in range(50)]
    assert [drawn.count(steps) / 5000 for steps in (1, 2, 999)] == pytest.approx([0.7, 0.2, 0.1], abs=0.02)


DRAWN = Latency.parse("1:2+4:1+7:2steps")


@QUIET
@given(
    policy=st.builds(Approaching, wait=st.integers(0, 4), horizon=st.just(8), interval=st.integers(1, 8)),
    latency=st.builds(Latency, st.integers(1, 10), st.sampled_from(["async", "sync"]))
    | st.sampled_from([DRAWN, replace(DRAWN, runner="sync")]),
)
def test_arms_share_their_prefix_by_fork_and_by_replay(
    world: TinyWorld, policy: Approaching, latency: Latency
) -> None:
    pair = play(world, policy, latency)
    again = play(world, policy, latency, "replay")
    assert again.record.identity() == pair.record.identity()
    record = PairRecord.from_dict(pair.record.to_dict())
    assert record == pair.record
    base, dynamic = (record.arms[name] for name in ("base", "dynamic"))
    assert base.latency == dynamic.latency == str(latency)
    if not dynamic.firings:
        return
    event = dynamic.firings[0]
    assert pair.base.trajectory.executed[event.step - 1].link.hex() == event.prefix_proof
    trajectory = pair.rollouts["dynamic"].trajectory
    bound = latency.drawn_for(make_case("target_relocation", distance_m=0.25).case_id)
    for before, query in pairwise(trajectory.queries):
        assert query.step - before.step == bound.interval(policy.spec.query_interval, before.index)
    if dynamic.response_step is not None:
        asked = next(query for query in trajectory.queries if query.step == dynamic.response_step)
        there = dynamic.response_step + bound.delay(asked.index)
        assert dynamic.stale_actions == min(there, BUDGET) - event.step


def test_no_delay_leaves_every_byte_as_it_is(world: TinyWorld) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=2, horizon=8, interval=4)
    plain = measure_pair(case, world, policy).record
    assert measure_pair(case, world, policy, arms=late(case, Latency.parse("0steps"))).record.identity() == (
        plain.identity()
    )
    assert not plain.to_dict()["arms"]["base"].keys() & {"latency", "held_steps"}


def test_the_robot_waits_for_the_first_answer_and_then_goes_on_with_the_chunk_before(
    world: TinyWorld,
) -> None:
    pair = play(world, Approaching(horizon=8, interval=4), Latency(3))
    executed = pair.base.trajectory.executed
    assert [step.held for step in executed[:8]] == [True] * 3 + [False] * 5
    assert executed[0].action.tolist() == list(NOOP_ACTION)
    assert pair.record.arms["base"].held_steps == 3
    assert [query.step for query in pair.base.queries] == list(range(0, BUDGET, 4))


class Closing(Approaching):
    """Closes the fingers at once."""

    def predict(
        self, observation: object, query: object
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        actions = super().predict(observation, query)  # type: ignore[arg-type]
        return np.column_stack([actions[:, :6], np.ones(len(actions))])


def test_late_actions_of_each_chunk_are_dropped_by_its_own_delay(world: TinyWorld) -> None:
    latency = Latency.parse("1:1+3:1+6:1steps")
    pair = play(world, Approaching(horizon=20, interval=4), latency)
    base, bound = pair.base.trajectory, latency.drawn_for(pair.record.case_id)
    delays = {bound.delay(query.index) for query in base.queries}
    assert delays == {1, 3, 6}
    first = bound.delay(0)
    assert [step.held for step in base.executed[: first + 1]] == [True] * first + [False]
    for before, query in pairwise(base.queries):
        there = query.step + bound.delay(query.index)
        for step in range(query.step, min(there + 1, base.step)):
            chunk, waited = (query, 0) if step >= there else (before, first if before.index == 0 else 0)
            expected = chunk.actions[step - chunk.step - waited]
            assert base.executed[step].action.tolist() == expected.tolist(), step


def test_a_blocking_runner_keeps_the_gripper_while_it_waits(world: TinyWorld) -> None:
    pair = play(world, Closing(horizon=4, interval=4), Latency(2, "sync"))
    executed = pair.base.trajectory.executed
    assert [step.held for step in executed[:12]] == [True, True, False, False, False, False] * 2
    assert executed[6].action.tolist() == [0.0] * 6 + [1.0]


def test_under_absolute_control_a_robot_that_waits_stays_where_it_is(world: TinyWorld) -> None:
    pair = play(world, Posing(horizon=2, interval=2), Latency(3, "sync"))
    hand = pair.base.end_effector
    assert np.abs(hand[2] - hand[0]).max() < 1e-3
    actions = pair.base.actions
    assert actions[5].tobytes() == actions[6].tobytes() == actions[4].tobytes()


def test_the_pieces_go_on_with_the_latency_of_the_prefix(world: TinyWorld) -> None:
    case, policy = make_case("target_relocation", distance_m=0.25), Approaching(horizon=8, interval=4)
    whole = play(world, policy, Latency(3))
    branch = play_prefix(case, world, policy, Latency(3))
    assert branch is not None
    assert whole.dynamic is not None
    inject(case, world)
    assert continue_rollout(branch, case, world, policy).actions.tobytes() == whole.dynamic.actions.tobytes()


@QUIET
@given(
    policy=st.builds(Approaching, wait=st.just(2), horizon=st.integers(4, 8), interval=st.integers(1, 4)),
    steps=st.integers(1, 9),
    runner=st.sampled_from(["", ",sync"]),
    usual=st.sampled_from([NO_LATENCY, Latency(2)]),
    back=st.integers(0, 12),
    prefix=st.sampled_from(["fork", "replay"]),
)
def test_answers_are_late_from_an_entry_of_the_schedule_on(
    world: TinyWorld, policy: Approaching, steps: int, runner: str, usual: Latency, back: int, prefix: str
) -> None:
    case = make_case("target_relocation", distance_m=0.25)
    delay = DelayAnswers(f"{steps}steps{runner}")
    schedule = (Entry(Proximity("box_1", 0.3), delay), Entry(StepsAfter(max(back, 1)), Revert(0)))
    arms = (Arm("base", latency=usual), Arm("dynamic", schedule[: 1 + (back > 0)], latency=usual))
    settings = PairSettings(prefix)  # type: ignore[arg-type]
    pair = measure_pair(case, world, policy, settings, arms=arms)
    base, dynamic = (pair.rollouts[name].trajectory for name in ("base", "dynamic"))
    assert PairRecord.from_dict(pair.record.to_dict()) == pair.record
    start, end = (*(firing.queries for firing in dynamic.firings), len(dynamic.queries))[:2]
    late = Latency.parse(delay.latency or "")
    for before, query in pairwise(dynamic.queries):
        takes = late if start <= before.index < end else usual
        assert query.step - before.step == takes.interval(policy.spec.query_interval, before.index)
    firing = dynamic.firings[0]
    assert firing.link.hex() == firing.proof  # the world is as it was
    shared = min(dynamic.queries[start].step, base.step) if start < len(dynamic.queries) else base.step
    assert [step.link for step in dynamic.executed[:shared]] == [step.link for step in base.executed[:shared]]
    arm = pair.record.arms["dynamic"]
    assert arm.latency == (None if usual == NO_LATENCY else "2steps")
    assert arm.held_steps == sum(step.held for step in dynamic.executed)
    if start < len(dynamic.queries):
        there = dynamic.queries[start].step + (late if start < end else usual).delay(start)
        assert arm.stale_actions == min(there, BUDGET) - firing.step
    with pytest.raises(AdapterError, match="arm 'dynamic' has a latency"):
        ArmEnv(case, world, arms[1])


def test_a_rollout_that_is_driven_from_outside_is_asked_at_the_same_steps(world: TinyWorld) -> None:
    policy, arm = Approaching(horizon=8, interval=4), Arm("base", latency=Latency(6))
    case = make_case("target_relocation", distance_m=0.25)
    rollout = Rollout.start(Stage(case, world, policy), (arm,))
    asked = []
    while (query := rollout.due()) is not None:
        asked.append(query.step)
        rollout.answer(policy.predict(rollout.observed(), query))
    assert asked == list(range(0, BUDGET, 6))
    with pytest.raises(AdapterError, match="arm 'base' has a latency"):
        ArmEnv(case, world, arm)


def test_a_record_that_contradicts_its_latency_is_refused(world: TinyWorld) -> None:
    record = play(world, Approaching(horizon=8, interval=4), Latency(3)).record
    dynamic = record.arms["dynamic"]
    assert dynamic.stale_actions is not None
    for wrong in (
        structs.replace(dynamic, stale_actions=dynamic.stale_actions - 3),
        structs.replace(dynamic, held_steps=None),
        structs.replace(dynamic, latency="3"),
    ):
        values = structs.replace(record, arms={**record.arms, "dynamic": wrong}).to_dict()
        with pytest.raises(ReportError):
            PairRecord.from_dict(values)
