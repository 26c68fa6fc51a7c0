"""Runs of a policy that declares which suites it supports."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.comparison.compare_files import comparison_html
from pytest_libero_max.report.comparison.comparison_sections import comparison_lines
from pytest_libero_max.report.gate_results import decide
from pytest_libero_max.report.gates import evaluate_gate, parse_gate, parse_gates
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import POLICY, PROVENANCE, plain, plan, record_of, run_of, selected, write_run

PAIRS = plan(per_cell=2)
SPATIAL = [pair for pair in PAIRS if pair.suite == "libero_spatial"]
PARTIAL: Json = {**POLICY, "suites": ["libero_spatial"]}


def _report(played: int = 32) -> Report:
    records = [record_of(pair, True, True, policy=PARTIAL) for pair in SPATIAL[:played]]
    return build_report(records, [], PAIRS, PROVENANCE)


def _run(whole: bool) -> StoredRun:
    pairs = PAIRS if whole else SPATIAL
    policy = POLICY if whole else PARTIAL
    records = [record_of(pair, True, index % 4 > 0, policy=policy) for index, pair in enumerate(pairs)]
    return run_of(PAIRS, records)


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
    words = "PARTIAL: the policy does not support libero_object. Its 32 pairs"
    for text in (" ".join(summary_lines(report)), markdown(report), html(report, [], ["pytest"])):
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
    said = "Unsupported cases: 32 by partial. Runs that do not support all cases have no rank."
    assert f"WARNING: {said}" in lines
    assert any(line.split()[:3] == ["partial", "--", "--"] for line in lines)


def test_a_comparison_still_refuses_cases_that_are_merely_missing() -> None:
    whole = _run(True)
    lacking = run_of(PAIRS, (record for record in whole.records if record.case_id != SPATIAL[0].case_id))
    with pytest.raises(ReportError, match="--restrict"):
        compare_runs({"whole": lacking, "partial": _run(False)})


def test_a_gate_against_a_partial_run_is_undecidable(tmp_path: Path) -> None:
    for name, run in (("whole", _run(True)), ("partial", _run(False))):
        write_run(tmp_path / name, run)
    (result,) = decide(parse_gates(["regressions_vs(partial) <= 3"]), tmp_path / "whole", tmp_path)
    assert result.verdict == "undecidable"
    assert "the 32 pairs" in result.reason


def test_a_partial_run_beside_several_whole_ones_changes_none_of_their_results() -> None:
    whole = {"one": _run(True), "two": _two()}
    alone = plain(compare_runs(whole))
    beside = plain(compare_runs({"one": whole["one"], "partial": _run(False), "two": whole["two"]}))
    (apart,) = beside.pop("apart")
    assert alone.pop("apart") == []
    assert beside == alone
    assert (apart["name"], apart["unsupported"], apart["unsupported_suites"]) == (
        "partial",
        32,
        ["libero_object"],
    )
    assert apart["result"]["played"] == apart["result"]["planned"] == 32
    assert apart["result"]["outcomes"]["regression"] == 8
    assert list(apart["by_suite"]) == ["libero_spatial"]


def test_all_runs_are_compared_on_what_the_partial_one_supports_if_that_is_asked_for() -> None:
    runs = {"one": _run(True), "partial": _run(False), "two": _two()}
    comparison = compare_runs(runs, restrict=True)
    assert (comparison.pairs.common, comparison.apart) == (32, [])
    assert [run.rank is None for run in comparison.runs] == [False, True, False]


def test_partial_runs_of_the_same_suites_are_compared_with_each_other() -> None:
    comparison = compare_runs({"one": _run(False), "two": _run(False)})
    assert (len(comparison.runs), comparison.apart) == (2, [])


def test_every_writer_lists_partial_runs_apart() -> None:
    comparison = compare_runs({"one": _run(True), "partial": _run(False), "two": _two()})
    lines = comparison_lines(comparison)
    start = lines.index("Runs apart")
    assert [line.split() for line in lines[start + 2 : start + 5]] == [
        ["libero_object", "unsupported", "n/a", "n/a", "n/a"],
        ["libero_spatial", "32", "100.0%", "75.0%", "-25.0", "[-43.4,", "-5.1]"],
        ["all", "supported", "32", "100.0%", "75.0%", "-25.0", "[-43.4,", "-5.1]"],
    ]
    page = comparison_html(comparison)
    assert "listed apart" in page
    assert ">all supported<" in page
    assert "listed apart" not in comparison_html(compare_runs({"one": _run(True), "two": _two()}))


def test_a_partial_run_on_another_substrate_is_refused() -> None:
    other = run_of(PAIRS, _run(False).records, {**PROVENANCE, "substrate": {"name": "libero"}})
    with pytest.raises(ReportError, match="embedded and libero"):
        compare_runs({"one": _run(True), "two": _two(), "partial": other})


def _two() -> StoredRun:
    """A run of all suites in which nothing succeeds after the event."""
    return run_of(PAIRS, (record_of(pair, True, False) for pair in PAIRS))
