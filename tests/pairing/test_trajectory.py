from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.pairing.trajectory import QueryResult, Step, Trajectory, next_link

NOWHERE = np.zeros(3)


@st.composite
def servings(draw: st.DrawFn) -> tuple[int, list[int]]:
    """Q, and for each query how many actions it returns."""
    horizon = draw(st.integers(1, 12))
    interval = draw(st.integers(1, horizon))
    return interval, draw(st.lists(st.integers(interval, horizon), min_size=1, max_size=6))


def begun(interval: int) -> Trajectory:
    return Trajectory.begin(interval, bytes(32), 1.0)


def answered(trajectory: Trajectory, length: int) -> Trajectory:
    """The trajectory with one more query, whose actions are (number of the query, number of the action)."""
    index = len(trajectory.queries)
    actions = np.array([[index, number] for number in range(length)], dtype=float)
    return trajectory.answered(QueryResult(index, trajectory.step, actions))


def stepped(trajectory: Trajectory, success: bool = False) -> Trajectory:
    digest = bytes([trajectory.step] * 32)
    link = next_link(trajectory.link, trajectory.next_action, digest)
    return trajectory.stepped(Step(trajectory.next_action, NOWHERE, NOWHERE, 0.5, success, link), digest)


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
            assert trajectory.pending[0].tobytes() == trajectory.next_action.tobytes()
            trajectory = stepped(trajectory)
            assert not trajectory.just_asked
    executed = [tuple(action) for action in trajectory.actions.tolist()]
    assert executed == [(query, i) for query in range(len(lengths)) for i in range(interval)]


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
    trajectory: Any = stepped(answered(begun(1), 1))
    with pytest.raises(IndexError):
        _ = trajectory.next_action
