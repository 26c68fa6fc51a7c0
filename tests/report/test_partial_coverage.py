"""Runs of a policy that declares which suites it supports."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.comparison.compare_text import comparison_lines
from pytest_libero_max.report.gate_results import decide
from pytest_libero_max.report.gates import evaluate_gate, parse_gate, parse_gates
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.markdown import markdown
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, StoredRun
from tests.report.made_up import POLICY, PROVENANCE, plain, plan, record_of, selected

PAIRS = plan(per_cell=2)
SPATIAL = [pair for pair in PAIRS if pair.suite == "libero_spatial"]
PARTIAL: Json = {**POLICY, "suites": ["libero_spatial"]}


def _report(played: int = 32) -> Report:
    records = [record_of(pair, True, True, policy=PARTIAL) for pair in SPATIAL[:played]]
    return build_report(records, [], PAIRS, PROVENANCE)


def _run(whole: bool) -> StoredRun:
    pairs = PAIRS if whole else SPATIAL
    records = [record_of(pair, True, index % 4 > 0, policy=POLICY if whole else PARTIAL)
               for index, pair in enumerate(pairs)]  # fmt: skip
    return StoredRun(Run(tuple(PAIRS), PROVENANCE), tuple(records), (), torn=False)


def test_unsupported_pairs_are_neither_planned_nor_missing_nor_failed() -> None:
    pairs = plain(_report())["pairs"]
    counts = {key: pairs[key] for key in ("planned", "played", "missing", "invalid", "unsupported")}
    assert counts == {"planned": 32, "played": 32, "missing": 0, "invalid": 0, "unsupported": 32}
    assert pairs["complete"] is True
    assert pairs["unsupported_suites"] == ["libero_object"]
    assert plain(_report())["overall"]["dynamic_success"]["of"] == 32
    assert list(plain(_report())["by"]["suite"]) == ["libero_spatial"]


def test_a_supported_pair_that_was_not_played_is_missing() -> None:
    pairs = plain(_report(played=31))["pairs"]
    assert (pairs["missing"], pairs["unsupported"], pairs["complete"]) == (1, 32, False)


def test_every_report_says_what_is_unsupported() -> None:
    report = _report()
    words = "PARTIAL: 32 pairs of libero_object are unavailable"
    for text in ("\n".join(summary_lines(report)), markdown(report), html(report, [], ["pytest"])):
        assert words in text
        assert "32 of them unsupported" in text


def test_gates_see_that_a_part_is_unsupported() -> None:
    report = replace(_report(), selection=selected(True))
    assert evaluate_gate(parse_gate("whole_track == 1"), report).verdict == "failed"
    assert evaluate_gate(parse_gate("unsupported == 0"), report).value == 32
    assert evaluate_gate(parse_gate("suite.libero_object.dynamic_sr >= 0.5"), report).verdict == "undecidable"
    assert evaluate_gate(parse_gate("dynamic_sr >= 0.5"), report).passed


def test_a_comparison_is_on_the_supported_cases_and_ranks_whole_runs_alone() -> None:
    comparison = compare_runs({"whole": _run(True), "partial": _run(False)})
    assert plain(comparison)["pairs"]["common"] == 32
    assert plain(comparison)["pairs"]["unsupported"] == {"whole": 0, "partial": 32}
    assert {run["name"]: run["rank"] for run in plain(comparison)["runs"]} == {"whole": 1.0, "partial": None}
    lines = comparison_lines(comparison)
    assert "Unsupported cases: 32 by partial. Runs that do not support all cases have no rank." in lines
    assert any(line.startswith("  --     --  partial") for line in lines)


def test_a_comparison_still_refuses_cases_that_are_merely_missing() -> None:
    lacking = _run(True)
    lacking = StoredRun(
        lacking.run, tuple(r for r in lacking.records if r.case_id != SPATIAL[0].case_id), (), False
    )
    with pytest.raises(ReportError, match="do not share all cases"):
        compare_runs({"whole": lacking, "partial": _run(False)})


def test_a_gate_against_a_partial_run_is_undecidable(tmp_path: Path) -> None:
    for name, run in (("whole", _run(True)), ("partial", _run(False))):
        store = PairStore(tmp_path / name, run.run)
        for record in run.records:
            store.append(record)
        store.close()
    (result,) = decide(parse_gates(["regressions_vs(partial) <= 3"]), tmp_path / "whole", tmp_path)
    assert result.verdict == "undecidable"
    assert "the 32 pairs that both policies support" in result.reason
