from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from pytest_libero_max.cli import main
from pytest_libero_max.lab.costs import Cost
from pytest_libero_max.lab.fleet import Fleet, costs_of, play, workers_fed
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, StoredRun
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of

PAIR = Cost(worker_s=2.0, calls=10, policy_s=1.0)


def test_workers_share_the_pairs() -> None:
    assert play([PAIR] * 8, Fleet(workers=1)).seconds == pytest.approx(24.0)
    played = play([PAIR] * 8, Fleet(workers=4))
    assert played.seconds == pytest.approx(6.0)
    assert played.computing == pytest.approx(1.0)
    assert played.bottleneck == "workers"


def test_the_last_long_pair_leaves_workers_without_work() -> None:
    played = play([PAIR] * 2 + [Cost(9.0, 0, 0.0)], Fleet(workers=2))
    assert played.seconds == pytest.approx(12.0)
    assert played.computing == pytest.approx(15.0 / 24.0)


def test_a_query_in_a_worker_takes_what_is_said() -> None:
    assert play([PAIR] * 4, Fleet(workers=2, query_s=0.5)).seconds == pytest.approx(2 * (2.0 + 5.0))


def test_one_worker_waits_for_each_answer() -> None:
    played = play([PAIR] * 3, Fleet(workers=1, servers=1, query_s=0.1))
    assert played.seconds == pytest.approx(3 * 3.0)
    assert played.serving == pytest.approx(1 / 3)


@pytest.mark.parametrize("servers", [1, 2, 5])
def test_servers_that_never_rest_are_the_bottleneck(servers: int) -> None:
    played = play([PAIR] * 200, Fleet(workers=50, servers=servers, query_s=0.1))
    assert played.seconds == pytest.approx(200 * 10 * 0.1 / servers, rel=0.05)
    assert played.bottleneck == "policy servers"
    assert played.serving > 0.95


def test_servers_answer_batches() -> None:
    alone = play([PAIR] * 200, Fleet(workers=50, servers=1, query_s=0.1))
    together = play([PAIR] * 200, Fleet(workers=50, servers=1, query_s=0.1, batch=8))
    assert together.seconds == pytest.approx(alone.seconds / 8, rel=0.1)
    slower = Fleet(workers=50, servers=1, query_s=0.1, batch=8, batch_s=0.8)
    assert slower.answer_s(1) == pytest.approx(0.1)
    assert slower.answer_s(5) == pytest.approx(0.5)
    assert play([PAIR] * 200, slower).seconds == pytest.approx(alone.seconds, rel=0.1)


def test_with_one_worker_for_each_server_nobody_waits_in_a_queue() -> None:
    with_servers = play([PAIR] * 40, Fleet(workers=4, servers=4, query_s=0.1))
    assert with_servers.seconds == pytest.approx(play([PAIR] * 40, Fleet(workers=4)).seconds)


def test_a_slow_disk_is_the_bottleneck_of_many_workers() -> None:
    played = play([PAIR] * 500, Fleet(workers=250, record_s=0.1))
    assert played.seconds == pytest.approx(500 * 0.1 + 3.0)
    assert played.bottleneck == "controller"


@pytest.mark.parametrize(("clients", "measured_s"), [(1, 79.8), (2, 50.9), (4, 50.5), (8, 51.3)])
def test_the_measured_times_of_one_server_are_met(clients: int, measured_s: float) -> None:
    """The table "One policy server" of ``reports/cost.md``."""
    pair = Cost(worker_s=1.45, calls=57, policy_s=57 * 0.0569)
    played = play([pair] * 16, Fleet(workers=clients, servers=1, query_s=0.0569))
    assert played.seconds == pytest.approx(measured_s, rel=0.07)


def test_one_controller_feeds_as_many_workers_as_records_fit_into_a_pair() -> None:
    assert workers_fed([PAIR] * 3, Fleet(workers=1, record_s=0.01)) == 300
    assert workers_fed([PAIR], Fleet(workers=1, query_s=0.8, record_s=0.01)) == 1000
    assert workers_fed([PAIR], Fleet(workers=1, record_s=100.0)) == 1
    assert workers_fed([PAIR], Fleet(workers=1)) is None


TIMINGS = {"pair_s": 8.0, "reset_s": 0.1, "observe_s": 3.2, "policy_s": 3.2}
PLAN = plan()


@pytest.fixture
def run(tmp_path: Path) -> str:
    """A stored run of 32 pairs of eight seconds, with 32 calls of 100 ms each."""
    store = PairStore(tmp_path / "run", Run(tuple(PLAN), PROVENANCE))
    for pair in PLAN:
        store.append(record_of(pair, True, True, timings=TIMINGS))
    store.close()
    return str(tmp_path / "run")


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["--workers=2", "--record-ms=0"], ["4.80 s", "32 calls", "3.20 s", "2 min, 15 pairs/min", "100%"]),
        (["--workers=16", "--servers=1"], ["1 policy server", "100 ms a query"]),
        (["--workers=16", "--servers=1", "--query-ms=20", "--batch=4"], ["20 ms a query", "4 together"]),
        (["--track=lite", "--workers=8", "--shards=4"], ["track lite, 800 pairs", "4 shards"]),
        (["--workers=17", "--record-ms=1000"], ["feeds 8 workers", "at least 3 shards"]),
    ],
)
def test_a_plan_is_printed_from_the_timings_of_a_run(
    run: str, words: list[str], values: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "time", run, *words]) == 0
    text = capsys.readouterr().out
    assert [value for value in values if value not in text] == []
    (bottleneck,) = (line for line in text.splitlines() if "<-" in line)
    slow = "controller" if "--record-ms=1000" in words else "policy" if "--servers=1" in words else "workers"
    assert bottleneck.split()[0] == slow


def test_suites_that_the_policy_does_not_play_are_left_out() -> None:
    policy = {**POLICY, "suites": ["libero_spatial"]}
    pairs = [pair for pair in PLAN if pair.suite == "libero_spatial"]
    records = tuple(record_of(pair, True, True, timings=TIMINGS, policy=policy) for pair in pairs)
    stored = StoredRun(Run(tuple(PLAN), PROVENANCE), records, (), torn=False)
    elsewhere = [replace(pair, suite="libero_10", case_id=f"{pair.case_id}-10") for pair in PLAN]
    assert len(costs_of([*PLAN, *elsewhere], stored, "All")) == len(pairs)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--batch=2"], "--servers"), (["--shards=2"], "--shards=2"), (["--track=smok"], "smoke")],
)
def test_what_cannot_be_planned_is_said(
    run: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "time", run, *arguments]) == 1
    assert message in capsys.readouterr().err


def test_a_run_without_a_pair_teaches_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    PairStore(tmp_path, Run(tuple(PLAN), PROVENANCE)).close()
    assert main(["plan", "time", str(tmp_path)]) == 1
    assert "no measured pair" in capsys.readouterr().err
