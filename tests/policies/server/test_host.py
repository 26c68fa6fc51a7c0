from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest

from pytest_libero_max.errors import ActionError, AdapterError, ServerError
from pytest_libero_max.policies.contract import BatchItem, PolicySpec
from pytest_libero_max.policies.server import host as hosts
from pytest_libero_max.policies.server.batching import Batching
from pytest_libero_max.policies.server.host import Host, InferenceRequest, InferenceResult, Place
from pytest_libero_max.policies.server.metrics import Metrics
from tests.conformance.policies import Sound
from tests.policies.clients import fakes
from tests.policies.server.policies import Batched, Counting, at_once


def request(index: int, place: Place | None = None, task: int = 3) -> InferenceRequest:
    item = BatchItem(fakes.observation(), fakes.query(index), replace(fakes.EPISODE, task_index=task))
    return InferenceRequest(item, place)


@contextmanager
def hosted(policy: Any, **options: Any) -> Iterator[Host]:
    host = Host(policy, "adapter abc", **options)
    with host.open():
        yield host


def ask_all(host: Host, *indices: int) -> list[InferenceResult]:
    with host.client(), host.client(), host.client():
        return at_once(*(lambda index=index: host.ask(request(index)) for index in indices))


@pytest.mark.parametrize(("pad", "size"), [(False, 3), (True, 8)])
def test_a_batch_answers_each_query_as_it_is_answered_alone(pad: bool, size: int) -> None:
    policy = Batched()
    with hosted(policy, batching=Batching(8, 60.0, pad)) as host:
        answers = ask_all(host, 0, 1, 2)
    assert policy.sizes == [size]
    for index, answer in enumerate(answers):
        assert answer.batch == 3
        assert answer.actions.tobytes() == Sound().predict(fakes.observation(), fakes.query(index)).tobytes()


def test_a_query_that_makes_trouble_costs_its_company_nothing() -> None:
    class Choosy(Batched):
        def chunk(self, observation: Any, query: Any) -> Any:
            if query.index == 1:
                raise RuntimeError("not this one")
            return super().chunk(observation, query)[: 9 - query.index]

    def outcome(index: int) -> Any:
        try:
            return host.ask(request(index)).actions.shape
        except (AdapterError, ActionError) as error:
            return type(error), str(error)

    with hosted(Choosy(), batching=Batching(3, 60.0)) as host, host.client(), host.client(), host.client():
        good, raised, short = at_once(*(lambda index=index: outcome(index) for index in (0, 1, 7)))
    assert good == (8, 7)
    assert raised[0] is AdapterError
    assert "RuntimeError in predict_batch, 1 item" in raised[1]
    assert short[0] is ActionError


def test_another_number_of_answers_than_of_items_is_named() -> None:
    class Losing(Batched):
        def predict_batch(self, items: Any) -> list[Any]:
            return []

    with (
        hosted(Losing(), batching=Batching(2)) as host,
        pytest.raises(AdapterError, match="0 answers from predict_batch"),
    ):
        host.ask(request(0))


def test_memories_of_connections_that_end_do_not_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hosts, "RECONNECT_S", -1.0)
    with hosted(Counting()) as host:
        for number in range(20):
            with host.client():
                host.ask(request(0, Place(f"client {number}")))
        assert host._memories is not None
        assert len(host._memories) == 1


def test_after_an_error_no_memory_of_another_is_left() -> None:
    class Once(Counting):
        def predict(self, observation: Any, query: Any) -> Any:
            answer = super().predict(observation, query)
            if query.index == 9:
                raise RuntimeError("lost")
            return answer

    with hosted(Once()) as host:
        first = host.ask(request(0, Place("a")))
        with pytest.raises(AdapterError, match="lost"):
            host.ask(request(9, Place("a", first.memory)))
        assert host.ask(request(1, Place("a", first.memory))).actions[0, 0] == 0.01


@pytest.mark.parametrize(
    ("policy", "batching", "message"),
    [
        (Counting, Batching(2), "has a memory .* Leave --max-batch out"),
        (Sound, Batching(2), r"has no predict_batch\(items\), so --max-batch=2"),
    ],
)
def test_batches_are_refused_where_there_are_none(policy: Any, batching: Batching, message: str) -> None:
    with pytest.raises(AdapterError, match=message):
        Host(policy(), "x", batching)


def test_a_privileged_policy_is_refused() -> None:
    privileged = Sound()
    privileged.spec = PolicySpec("privileged", privileged=True)
    with pytest.raises(AdapterError, match="reads the simulator"):
        Host(privileged, "x")


def test_queries_batches_errors_and_clients_are_counted() -> None:
    pytest.importorskip("prometheus_client", reason="the extra 'metrics' has it")
    metrics = Metrics()
    with hosted(Batched(), batching=Batching(3, 60.0), metrics=metrics) as host:
        ask_all(host, 0, 1, 2)
        with host.client():
            host.refused(ServerError("x"))
            text, kind = metrics.text()
    assert kind.startswith("text/plain")
    for line in (
        "libero_max_latency_seconds_count 3.0",
        "libero_max_queue_seconds_count 3.0",
        "libero_max_policy_seconds_count 1.0",
        "libero_max_batch_size_sum 3.0",
        'libero_max_batch_size_bucket{le="2.0"} 0.0',
        'libero_max_errors_total{error="ServerError"} 1.0',
        "libero_max_clients 1.0",
    ):
        assert line in text.splitlines()


def test_metrics_say_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(AdapterError, match=r"pip install -e '\.\[metrics\]'"):
        Metrics()
