"""Made-up results in the form of the authors' runner, read into a report."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.lab.readers.authors import END_TO_END, PAIRED, AuthorsResults
from pytest_libero_max.report.gates import parse_gate
from pytest_libero_max.report.read_results import contrast_with, decide_results, report_of_results
from pytest_libero_max.report.readers import reader_of
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats.blocks import Outcomes
from tests.report.made_up import PROVENANCE, record_of

CASES = list(load_track("genuine/paper-lite"))
CODES = {
    "observation": "OBS",
    "geometry": "GEO",
    "appearance_and_clutter": "CLUTTER",
    "path_constraint": "OBSTACLE",
}


def end_to_end(number: int, base: bool, dynamic: bool, **changes: Any) -> Json:
    """A line of end_to_end_results.jsonl."""
    pair = PlannedPair.of(CASES[number])
    return {
        "pair_id": pair.case_id,
        "control_correct": base,
        "intervention_correct": dynamic,
        "trigger_reached": True,
        "response_query_reached": True,
        "terminal_status": "triggered",
        "change_type": pair.event,
        "change_family": CODES[EVENTS[pair.event].family],
        "severity": pair.severity,
        "intervention_draw_id": pair.variant,
        "task_suite_name": pair.suite,
        "substrate_category": pair.source_category,
        "timing_bucket": "middle",
        **changes,
    }


def paired(line: Json, exposure: int | None) -> Json:
    """The line of paired_results.jsonl of the same pair."""
    kept = ("pair_id", "control_correct", "intervention_correct", "change_family", "change_type", "severity")
    return {
        **{name: line[name] for name in kept},
        "scenario_id": line["pair_id"].removesuffix("-p195"),
        "seed": 1,
        "expected_response_mode": "continue",
        "adaptation_latency_steps": None,
        "safety_violations": None,
        "open_loop_exposure_steps": exposure,
    }


UNREACHED: Json = {
    "trigger_reached": False,
    "response_query_reached": False,
    "terminal_status": "trigger_unreached",
}


def write(folder: Path, lines: list[Json], exposures: list[Json] | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    for name, some in ((END_TO_END, lines), (PAIRED, exposures)):
        if some is not None:
            (folder / name).write_text("".join(json.dumps(line) + "\n" for line in some))
    return folder


def results_lines() -> tuple[list[Json], list[Json]]:
    """Of 800 cases 500 succeed in both arms, 100 in Base alone, 20 in Dynamic alone; 10 have no event."""
    lines = [
        end_to_end(n, n < 600, n < 500 or 600 <= n < 620, **(UNREACHED if n >= 790 else {}))
        for n in range(800)
    ]
    return lines, [paired(line, n % 5) for n, line in enumerate(lines[:790])]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("authors") / "v1", *results_lines())


def test_a_folder_of_the_authors_is_recognised(folder: Path, tmp_path: Path) -> None:
    assert isinstance(reader_of(folder), AuthorsResults)
    assert reader_of(tmp_path) is None
    (tmp_path / END_TO_END).write_text("")
    (tmp_path / "pairs.jsonl").write_text("")
    assert reader_of(tmp_path) is None  # a run of this package is one, whatever else lies there


def test_outcomes_have_a_report_that_says_what_it_lacks(folder: Path) -> None:
    report = report_of_results(AuthorsResults().read(folder, None))
    assert (report.pairs.planned, report.pairs.played, report.pairs.complete) == (800, 800, True)
    assert report.overall.outcomes == Outcomes(500, 20, 100, 180)
    assert report.overall.trigger_coverage.count == 790
    assert report.overall.stale_actions.mean == 2.0
    assert sum(row.played for row in report.by["event"].values()) == 800
    assert (report.policy, report.causes, report.sections) == (None, {"base": {}, "dynamic": {}}, {})
    assert "no proof" in report.warnings[0]
    assert report.inference.world == "paused"
    assert any("Base success" in line for line in summary_lines(report))


def test_gates_are_decided_as_far_as_outcomes_go(folder: Path) -> None:
    report = report_of_results(AuthorsResults().read(folder, None))
    texts = (
        "base_sr >= 70%",
        "delta.lower >= -5%",
        "base_sr_vs_published(pi05, 10%)",
        "base_sr_vs_published(smolvla, 10%)",
        "equivalent_vs(other, 5%)",
    )
    verdicts = [result.verdict for result in decide_results([parse_gate(text) for text in texts], report)]
    assert verdicts == ["passed", "failed", "passed", "failed", "undecidable"]


def test_a_run_is_compared_on_the_same_cases(folder: Path) -> None:
    results = AuthorsResults().read(folder, None)
    planned = tuple(PlannedPair.of(case) for case in CASES[495:505])
    records = tuple(record_of(pair, True, number > 0) for number, pair in enumerate(planned))
    run = RunOutcomes.of(StoredRun(Run(planned, PROVENANCE), records, (), torn=False))
    contrast = contrast_with(results, run)
    assert not isinstance(contrast, str)
    assert (contrast.cases, contrast.first_only, contrast.second_only) == (10, 1, 5)
    other = tuple(replace_digest(pair) for pair in planned)
    strangers = RunOutcomes.of(
        StoredRun(
            Run(other, PROVENANCE), tuple(record_of(pair, True, True) for pair in other), (), torn=False
        )
    )
    assert "no case of" in str(contrast_with(results, strangers))


def replace_digest(pair: PlannedPair) -> PlannedPair:
    import msgspec

    return msgspec.structs.replace(pair, case_digest="0" * 64)


def test_missing_pairs_are_missing_and_no_failures(tmp_path: Path) -> None:
    lines, exposures = results_lines()
    report = report_of_results(
        AuthorsResults().read(write(tmp_path / "v1", lines[:400], exposures[:400]), None)
    )
    assert (report.pairs.played, report.pairs.missing, report.headline.status) == (400, 400, "withheld")


def test_stale_actions_that_are_not_known_are_not_shown(tmp_path: Path) -> None:
    report = report_of_results(AuthorsResults().read(write(tmp_path / "v1", results_lines()[0]), None))
    assert report.overall.stale_actions.mean is None
    assert all(row.stale_actions.mean is None for row in report.by["event"].values())
    assert any("Stale actions" in text for text in report.warnings)


def test_arms_that_differ_without_an_event_are_said(tmp_path: Path) -> None:
    lines = [end_to_end(0, True, False, **UNREACHED), end_to_end(1, True, True)]
    results = AuthorsResults().read(write(tmp_path / "v1", lines), None)
    assert any("In 1 pair" in note for note in results.notes)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda lines: lines[0].update(change_type="visual_theme_switch"),
            "change_type='visual_theme_switch'",
        ),
        (lambda lines: lines[0].update(terminal_status="trigger_unreached"), "terminal_status"),
        (lambda lines: lines[0].update(control_correct="yes"), "line 1"),
        (lambda lines: lines.append(dict(lines[0])), "occurs twice"),
        (lambda lines: lines[0].pop("trigger_reached"), "trigger_reached"),
    ],
)
def test_damage_is_named(tmp_path: Path, damage: Callable[[list[Json]], object], message: str) -> None:
    lines = [end_to_end(0, True, True), end_to_end(1, True, False)]
    damage(lines)
    with pytest.raises(ReportError, match=message):
        AuthorsResults().read(write(tmp_path / "v1", lines), None)


def test_files_of_two_runs_are_refused(tmp_path: Path) -> None:
    lines = [end_to_end(0, True, True)]
    other = [paired(end_to_end(0, True, False), 2)]
    with pytest.raises(ReportError, match="of one run"):
        AuthorsResults().read(write(tmp_path / "v1", lines, other), None)


def test_cases_that_nobody_knows_need_their_manifest(tmp_path: Path) -> None:
    folder = write(tmp_path / "v1", [end_to_end(0, True, True, pair_id="elsewhere-p195")])
    with pytest.raises(OptionError, match="--cases=FILE"):
        AuthorsResults().read(folder, None)


def test_the_command_writes_report_and_page(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(folder), "--gate=base_sr >= 70%"]) == 0
    printed = capsys.readouterr().out
    assert "not from records" in printed
    assert "gate pass" in printed
    page = (folder / "report.html").read_text()
    assert "no proof" in page
    assert "Published results" in (folder / "report.md").read_text()
    assert json.loads((folder / "report.json").read_text())["pairs"]["played"] == 800


def test_the_options_are_for_results_of_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(tmp_path), "--beside=other"]) != 0
    assert "another runner" in capsys.readouterr().err
