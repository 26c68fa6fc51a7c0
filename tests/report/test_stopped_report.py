"""Reports of runs that a rule stopped: no interval but the rule's own, and the bias of their estimates."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_texts import stopped_texts
from pytest_libero_max.report.stopping_rule import BIAS
from pytest_libero_max.report.writers.summary import quiet_lines, summary_lines
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import StoredRun, read_pairs
from tests.report.made_up import plain

REPORTS = Path(__file__).parents[2] / "reports"

RUNS = (
    "smoke/stale_expert",
    "studies/camera-strength",
    "studies/latency-expert",
    "studies/cadence-servo",
    "studies/event-timing-servo",
    "studies/recovery-gated",
    "beyond/compound-servo",
    "monitors/servo",
    "safety/expert",
)
"""A run without a study, one of each, and one of each probe that has a table."""

_INTERVAL = re.compile(r"\[[+-]?\d+\.\d+, [+-]?\d+\.\d+\]")


def stopped_run(name: str, rule: str = "first_regression") -> StoredRun:
    stored = read_pairs(REPORTS / name)
    planned = len(stored.run.planned)
    stop = Stopped("it is a regression", planned, rule, len(stored.records) - 1)
    return replace(stored, records=stored.records[:-1], stopped=stop)


def numbers_of_intervals(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        for name, item in value.items():
            if name in ("lower", "upper", "p_value", "log10_p_value") and item is not None:
                yield item
            yield from numbers_of_intervals(item)
    if isinstance(value, list):
        for item in value:
            yield from numbers_of_intervals(item)


@pytest.mark.parametrize("name", RUNS)
def test_a_stopped_report_prints_no_interval(name: str) -> None:
    run = stopped_run(name)
    report = build_report(run.records, (), run.run.planned, run.run.provenance, run.stopped)
    document = plain(report)
    assert [*numbers_of_intervals({**document, "pairs": None, "provenance": None})] == []
    texts = [markdown(report), html(report, [], ["pytest"]), *summary_lines(report), *quiet_lines(report)]
    assert [found for text in texts for found in _INTERVAL.findall(text)] == []
    assert not any("the interval holds 0" in text for text in texts)
    ruled = " ".join(stopped_texts(report.pairs))
    for text in texts[:1] + texts[2:]:
        about = text.replace(ruled, "").splitlines()
        speaking = [line for line in about if "95%" in line and "have no 95% intervals" not in line]
        assert speaking == []
    assert "too few" not in texts[0].replace("too few pairs", "")


def test_a_stopped_report_says_that_its_estimates_are_beyond_the_truth() -> None:
    run = stopped_run("smoke/stale_expert")
    report = build_report(run.records, (), run.run.planned, run.run.provenance, run.stopped)
    assert report.pairs.stopped is not None
    assert report.pairs.stopped.bias == BIAS
    for text in (markdown(report), html(report, [], ["pytest"]), " ".join(summary_lines(report))):
        assert BIAS in " ".join(text.split())


@pytest.mark.parametrize(("rule", "bias"), [("errors:1", None), ("not_installed", BIAS)])
def test_a_rule_that_does_not_look_at_outcomes_makes_no_bias(rule: str, bias: str | None) -> None:
    run = stopped_run("smoke/stale_expert", rule)
    report = build_report(run.records, (), run.run.planned, run.run.provenance, run.stopped)
    assert report.pairs.stopped is not None
    assert report.pairs.stopped.bias == bias


def test_a_run_that_its_rule_stopped_at_its_last_pair_keeps_its_intervals_everywhere() -> None:
    whole = read_pairs(REPORTS / "smoke/stale_expert")
    planned = len(whole.run.planned)
    stop = Stopped("it is a regression", planned, "first_regression", planned - 1)
    completed = replace(whole, stopped=stop)
    report = build_report(completed.records, (), completed.run.planned, completed.run.provenance, stop)
    assert report == build_report(whole.records, (), whole.run.planned, whole.run.provenance)
    for run in (completed, stopped_run("smoke/stale_expert")):
        pairs = build_report(run.records, (), run.run.planned, run.run.provenance, run.stopped).pairs
        compared = compare_runs({"one": run, "two": whole}, restrict=True)
        assert run.stopped_by_rule == (pairs.stopped is not None)
        assert (compared.runs[0].paired_change.lower is None) == run.stopped_by_rule
        assert (compared.contrasts[0].p_value is None) == run.stopped_by_rule
        assert bool(compared.runs[0].warnings) == run.stopped_by_rule
