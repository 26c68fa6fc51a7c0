from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.pairing.trajectory import QueryResult, Step, Trajectory, next_link

NOWHERE = np.zeros(3)
HELD = np.full(2, -1.0)


@st.composite
def servings(draw: st.DrawFn) -> tuple[int, list[int]]:
    """Q, and for each query how many actions it returns."""
    horizon = draw(st.integers(1, 12))
    interval = draw(st.integers(1, horizon))
    return interval, draw(st.lists(st.integers(interval, horizon), min_size=1, max_size=6))


def begun(interval: int, latency: Latency = NO_LATENCY) -> Trajectory:
    return Trajectory.begin(interval, bytes(32), 1.0, latency)


def answered(trajectory: Trajectory, length: int) -> Trajectory:
    """The trajectory with one more query, whose actions are (number of the query, number of the action)."""
    index = len(trajectory.queries)
    actions = np.array([[index, number] for number in range(length)], dtype=float)
    return trajectory.answered(QueryResult(index, trajectory.step, actions))


def stepped(trajectory: Trajectory, success: bool = False) -> Trajectory:
    digest = bytes([trajectory.step] * 32)
    queued = trajectory.next_action
    action = HELD if queued is None else queued
    link = next_link(trajectory.link, action, digest)
    step = Step(action, NOWHERE, NOWHERE, 0.5, success, link, held=queued is None)
    return trajectory.stepped(step, digest)


@given(servings())
def test_the_first_q_actions_of_every_chunk_are_executed_in_order(serving: tuple[int, list[int]]) -> None:
    interval, lengths = serving
    trajectory = begun(interval)
    for length in lengths:
        assert trajectory.queued == 0
        assert not trajectory.pending.size
        trajectory = answered(trajectory, length)
        assert trajectory.just_asked
        while trajectory.queued:
            assert len(trajectory.pending) == trajectory.queued
            assert trajectory.next_action is not None
            assert trajectory.pending[0].tobytes() == trajectory.next_action.tobytes()
            trajectory = stepped(trajectory)
            assert not trajectory.just_asked
    executed = [tuple(action) for action in trajectory.actions.tolist()]
    assert executed == [(query, i) for query in range(len(lengths)) for i in range(interval)]


def robot_client(interval: int, delay: int, lengths: list[int], steps: int) -> list[tuple[float, ...]]:
    """The executed actions of a runner that keeps a queue of numbered actions, as LeRobot's client does.

    The number of an action is the number of actions executed before it; waiting executes none.
    """
    queue: dict[int, tuple[float, ...]] = {}
    arrivals: dict[int, dict[int, tuple[float, ...]]] = {}
    executed, done, asked = [], 0, 0
    for step in range(steps):
        if step % max(interval, delay) == 0:
            length = lengths[asked % len(lengths)]
            arrivals[step + delay] = {done + i: (float(asked), float(i)) for i in range(length)}
            asked += 1
        queue = arrivals.pop(step, queue)
        if done in queue:
            executed.append(queue[done])
            done += 1
        else:
            executed.append(tuple(HELD))
    return executed


@given(servings(), st.integers(0, 15))
def test_late_answers_are_executed_as_by_a_client_with_a_queue(
    serving: tuple[int, list[int]], delay: int
) -> None:
    interval, lengths = serving
    trajectory = begun(interval, Latency(delay))
    while trajectory.step < 60:
        if not trajectory.queued:
            trajectory = answered(trajectory, lengths[len(trajectory.queries) % len(lengths)])
        going_on = trajectory.pending
        trajectory = stepped(trajectory)
        assert bool(len(going_on)) != trajectory.executed[-1].held
    assert [tuple(step.action) for step in trajectory.executed] == robot_client(interval, delay, lengths, 60)


@given(servings(), st.integers(1, 15))
def test_a_blocking_runner_waits_and_then_executes_q_actions(
    serving: tuple[int, list[int]], delay: int
) -> None:
    interval, lengths = serving
    trajectory = begun(interval, Latency(delay, "sync"))
    for length in lengths:
        trajectory = answered(trajectory, length)
        while trajectory.queued:
            trajectory = stepped(trajectory)
    expected = [
        action
        for number in range(len(lengths))
        for action in [tuple(HELD)] * delay + [(float(number), float(i)) for i in range(interval)]
    ]
    assert [tuple(step.action) for step in trajectory.executed] == expected


@given(servings(), st.data())
def test_a_trajectory_that_was_kept_stays_what_it_was(
    serving: tuple[int, list[int]], data: st.DataObject
) -> None:
    interval, (length, *_) = serving
    kept = answered(begun(interval), length)
    for _ in range(data.draw(st.integers(0, interval))):
        kept = stepped(kept)
    before = (kept.proof, kept.step, kept.queued, len(kept.queries))
    one, other = answered_or_stepped(kept), answered_or_stepped(kept)
    assert one.proof == other.proof
    assert (kept.proof, kept.step, kept.queued, len(kept.queries)) == before


def answered_or_stepped(trajectory: Trajectory) -> Trajectory:
    if not trajectory.queued:
        trajectory = answered(trajectory, trajectory.query_interval)
    return stepped(trajectory)


def test_a_change_adds_a_link_only_where_the_world_changed() -> None:
    trajectory = begun(1)
    assert trajectory.altered(bytes(32)) is trajectory
    after = trajectory.altered(bytes([1]) * 32)
    assert after.link != trajectory.link == trajectory.first == after.first
    assert after.digest == bytes([1]) * 32


def test_success_is_that_of_the_last_step() -> None:
    trajectory = begun(2)
    assert not trajectory.success
    solved = stepped(answered(trajectory, 2), success=True)
    assert solved.success
    assert not stepped(solved).success


def test_an_empty_queue_has_no_next_action() -> None:
    assert stepped(answered(begun(1), 1)).next_action is None
