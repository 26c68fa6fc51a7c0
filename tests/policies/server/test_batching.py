from __future__ import annotations

import threading
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.server.batching import Batching, BatchQueue, Pending
from tests.policies.server.policies import at_once

Jobs = list[Pending[int, int]]
FOREVER_S = 60.0


class Doubling:
    """Answers with the double, and keeps the batches."""

    def __init__(self) -> None:
        self.batches: list[list[int]] = []

    def __call__(self, jobs: Jobs) -> None:
        self.batches.append([job.request for job in jobs])
        for job in jobs:
            job.result.set_result(2 * job.request)


def test_questions_of_all_clients_are_answered_together_without_waiting_longer() -> None:
    doubling = Doubling()
    batches: BatchQueue[int, int] = BatchQueue(Batching(8, FOREVER_S), lambda: 3, doubling)
    with batches.open():
        assert at_once(*(lambda number=number: batches.ask(number) for number in range(3))) == [0, 2, 4]
    assert [sorted(batch) for batch in doubling.batches] == [[0, 1, 2]]


def test_a_full_batch_does_not_wait() -> None:
    doubling = Doubling()
    batches: BatchQueue[int, int] = BatchQueue(Batching(2, FOREVER_S), lambda: 9, doubling)
    with batches.open():
        at_once(*(lambda number=number: batches.ask(number) for number in range(4)))
    assert [len(batch) for batch in doubling.batches] == [2, 2]


def test_a_question_waits_for_others_no_longer_than_it_may() -> None:
    doubling = Doubling()
    batches: BatchQueue[int, int] = BatchQueue(Batching(8, 0.01), lambda: 9, doubling)
    with batches.open():
        assert batches.ask(4) == 8
    assert doubling.batches == [[4]]


def test_a_mistake_while_answering_reaches_whoever_asked_and_nobody_else() -> None:
    def answer(jobs: Jobs) -> None:
        if jobs[0].request < 0:
            raise RuntimeError("a mistake")
        jobs[0].result.set_result(1)

    batches: BatchQueue[int, int] = BatchQueue(Batching(), lambda: 1, answer)
    with batches.open():
        with pytest.raises(RuntimeError, match="a mistake"):
            batches.ask(-1)
        assert batches.ask(0) == 1


def test_questions_that_wait_at_the_end_are_refused() -> None:
    entered, go_on = threading.Event(), threading.Event()

    def answer(jobs: Jobs) -> None:
        entered.set()
        go_on.wait(10)
        jobs[0].result.set_result(1)

    batches: BatchQueue[int, int] = BatchQueue(Batching(), lambda: 2, answer)

    def asked() -> Any:
        try:
            return batches.ask(1)
        except ServerError as error:
            return str(error)

    found: list[Any] = []
    with batches.open():
        threads = [threading.Thread(target=lambda: found.append(asked())) for _ in range(2)]
        threads[0].start()
        assert entered.wait(10)
        threads[1].start()
        threading.Timer(0.05, go_on.set).start()
    for thread in threads:
        thread.join(10)
    assert 1 in found
    assert "being stopped" in str(asked())


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0,), "max_batch=0"),
        ((2, -0.001), "max_wait_ms=-1"),
        ((2, float("nan")), "max_wait_ms=nan"),
        ((1, 0.0, True), "max_batch is 1"),
    ],
)
def test_values_that_make_no_sense_are_refused(values: Any, message: str) -> None:
    with pytest.raises(AdapterError, match=message):
        Batching(*values)
