from __future__ import annotations

from collections.abc import Container

import pytest

from pytest_libero_max.lab.bisection import GATE, Lost, Result, Revision, _outcome, has_ended, verdict_of
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import PROVENANCE, error_of, plan, record_of

PLANNED = plan()[:20]


def run_of(failed: Container[int], played: int = 20, stopped: Stopped | None = None) -> StoredRun:
    """A run of twenty pairs in which Dynamic fails at some places."""
    records = tuple(record_of(pair, True, place not in failed) for place, pair in enumerate(PLANNED[:played]))
    return StoredRun(Run(tuple(PLANNED), PROVENANCE), records, (), torn=False, stopped=stopped)


def test_lost_cases_are_those_that_both_have_measured_and_the_good_one_completes() -> None:
    lost = Lost.between(run_of({0, 1}), run_of(range(1, 9), played=12))
    assert (len(lost.case_ids), lost.gains, lost.pairs) == (7, 1, 12)
    assert lost.p_value == pytest.approx(9 * 8 / 2**8)  # B(8, 2) 2 ** 8, inverted
    assert lost.shown(0.3)
    assert not lost.shown(0.28)
    assert not Lost.between(run_of(range(9)), run_of(())).shown(0.5)  # gains alone
    assert Lost.between(run_of(()), run_of(())).p_value == 1.0


def test_a_run_has_ended_when_all_is_measured_or_its_rule_says_so() -> None:
    by_rule = Stopped("known", 20, "anytime:0.05", 8)
    assert has_ended(run_of(()), by_rule=False)
    assert not has_ended(run_of((), played=8), by_rule=True)
    assert has_ended(run_of((), played=8, stopped=by_rule), by_rule=True)
    assert not has_ended(run_of((), played=8, stopped=by_rule), by_rule=False)
    assert not has_ended(run_of((), played=8, stopped=Stopped("a full disk", 20)), by_rule=True)
    broken = StoredRun(
        Run(tuple(PLANNED), PROVENANCE), (), (error_of(PLANNED[0]),), torn=False, stopped=by_rule
    )
    assert not has_ended(broken, by_rule=True)


@pytest.mark.parametrize(("failed", "verdict"), [(range(9), "good"), (range(10), "bad"), (range(20), "bad")])
def test_a_revision_is_good_that_completes_more_than_half(failed: range, verdict: str) -> None:
    assert verdict_of(run_of(failed)) == verdict


@pytest.mark.parametrize(("failed", "verdict"), [((), "good"), (range(20), "bad")])
def test_the_verdict_of_a_stopped_run_is_that_of_its_rule(failed: Container[int], verdict: str) -> None:
    stopped = run_of(failed, 8, Stopped("the verdict of the gate is known", 20, "anytime:0.05", 8))
    provenance = {**PROVENANCE, "gates": [GATE], "order": "shuffled:1", "stopping_rule": "anytime:0.05"}
    known = StoredRun(
        Run(stopped.run.planned, provenance), stopped.records, (), torn=False, stopped=stopped.stopped
    )
    assert verdict_of(known) == verdict


def test_what_broke_elsewhere_is_counted_with_the_way_to_find_it() -> None:
    revisions = [Revision(f"step-{number}", f"step-{number}") for number in range(5)]
    good, bad = run_of(()), run_of(range(10))
    lost = Lost.between(good, bad)
    ends = {0: good, 1: run_of({0, 1}), 3: run_of(range(8)), 4: bad}
    looked = [Result("step-1", 10, "good", 8, 10), Result("step-2", 0, "cannot be played")]
    said = list(_outcome(revisions, looked, 1, 3, ends, lost))
    assert any("2 of 5" in line and "10 pairs" in line and "100" in line for line in said)
    assert any("step-3" in line and line.endswith("step-2.") for line in said)
    named = [line.strip() for line in said if line.startswith("  ")]
    assert named == sorted(it.item_id for it in PLANNED[2:8])
    assert said[-2].startswith("Lost before it: 2 ")
    assert said[-2].endswith("--bad step-1.")
    assert said[-1].startswith("Lost after it: 2 ")
    assert said[-1].endswith("--good step-3.")
