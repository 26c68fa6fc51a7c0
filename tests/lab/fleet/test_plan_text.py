from __future__ import annotations

import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from pytest_libero_max.cli import main
from pytest_libero_max.lab.fleet.fleet import Fleet
from pytest_libero_max.lab.fleet.plan_text import plan_lines
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, StoredRun
from tests.cli.test_cli import require_refusal
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of

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


def test_a_plan_says_how_long_and_what_is_the_bottleneck(
    run: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "time", run, "--workers", "2", "--record-ms", "0"]) == 0
    text = capsys.readouterr().out
    assert "32 measured pairs" in text
    assert "take a worker 4.80 s, and 32 calls of the policy, which took 3.20 s" in text
    assert "32 pairs with 2 workers, the policy in each of them:\n  2 min, 15 pairs/min\n" in text
    assert "workers         play 100% of their time  <- the bottleneck" in text
    assert main(["plan", "time", run, "--workers=16", "--servers=1"]) == 0
    text = capsys.readouterr().out
    assert "16 workers, 1 policy server, 100 ms a query:\n  2 min" in text
    assert re.search("policy servers  answer (9.|100)% of the time  <- the bottleneck", text)
    assert "with twice the policy servers: 5" in text
    assert main(["plan", "time", run, "--workers=16", "--servers=1", "--query-ms=20", "--batch=4"]) == 0
    assert "20 ms a query, up to 4 together in 20 ms" in capsys.readouterr().out


def test_another_track_is_planned_from_the_run(run: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "time", run, "--track=lite", "--workers=8", "--shards=4"]) == 0
    text = capsys.readouterr().out
    assert "track lite, 800 pairs with 8 workers" in text
    assert "4 shards: " in text


def test_suites_that_the_policy_does_not_play_are_left_out() -> None:
    policy = {**POLICY, "suites": ["libero_spatial"]}
    pairs = [pair for pair in PLAN if pair.suite == "libero_spatial"]
    records = tuple(record_of(pair, True, True, timings=TIMINGS, policy=policy) for pair in pairs)
    stored = StoredRun(Run(tuple(PLAN), PROVENANCE), records, (), torn=False)
    elsewhere = [replace(pair, suite="libero_10", case_id=f"{pair.case_id}-10") for pair in PLAN]
    lines = plan_lines(stored, [*PLAN, *elsewhere], "All", Fleet(workers=1))
    assert f"All, {len(pairs)} pairs with 1 worker, the policy in each of them:" in lines


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--batch=2"], "Give --servers"),
        (["--shards=2"], "--shards=2 also needs --track or --manifest"),
        (["--track=smok"], "smoke"),
    ],
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


def test_more_workers_than_one_controller_feeds_are_told_to_play_shards(
    run: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "time", run, "--workers=17", "--record-ms=1000"]) == 0
    text = capsys.readouterr().out
    assert re.search("controller .*<- the bottleneck\n  one controller feeds 8 workers with such pairs", text)
    assert "play at least 3 shards at once" in text
    assert main(["plan", "time", run, "--workers=8", "--record-ms=100"]) == 0
    assert "one controller feeds" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--workers 0", "argument --workers: '0', but must be a whole number from 1 to 1000000"),
        ("--query-ms nan", "argument --query-ms: 'nan', but must be a number from 0 to 1e+06"),
    ],
)
def test_numbers_out_of_range_are_refused(
    option: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    require_refusal(f"plan time run {option}", message, capsys)
