from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.pairing.queue import ActionQueue


@st.composite
def servings(draw: st.DrawFn) -> tuple[int, list[int]]:
    """Q, and for each query how many actions it returns."""
    horizon = draw(st.integers(1, 12))
    interval = draw(st.integers(1, horizon))
    return interval, draw(st.lists(st.integers(interval, horizon), min_size=1, max_size=6))


@given(servings())
def test_the_first_q_actions_of_every_chunk_are_executed_in_order(serving: tuple[int, list[int]]) -> None:
    interval, lengths = serving
    queue = ActionQueue(interval)
    executed = []
    for query, length in enumerate(lengths):
        assert len(queue) == 0
        queue.refill(np.array([[query, i] for i in range(length)], dtype=float))
        while len(queue):
            executed.append(tuple(queue.pop().tolist()))
    assert executed == [(query, i) for query in range(len(lengths)) for i in range(interval)]


@given(servings(), st.data())
def test_a_queue_continues_from_what_another_has_pending(
    serving: tuple[int, list[int]], data: st.DataObject
) -> None:
    interval, (length, *_) = serving
    queue = ActionQueue(interval)
    queue.refill(np.arange(7.0 * length).reshape(length, 7))
    for _ in range(data.draw(st.integers(0, interval))):
        queue.pop()
    other = ActionQueue(interval, queue.pending)
    assert len(other) == len(queue)
    while len(queue):
        assert other.pop().tobytes() == queue.pop().tobytes()


def test_the_queue_shares_no_memory_with_what_it_is_given_or_gives() -> None:
    chunk = np.zeros((3, 7))
    queue = ActionQueue(3)
    queue.refill(chunk)
    chunk[:] = 1.0
    queue.pending[:] = 2.0
    assert not queue.pop().any()
    assert not queue.pop().any()


def test_an_empty_queue_gives_nothing() -> None:
    queue = ActionQueue(2)
    with pytest.raises(IndexError):
        queue.pop()
    queue.refill(np.zeros((2, 7)))
    queue.pop()
    queue.pop()
    with pytest.raises(IndexError):
        queue.pop()
