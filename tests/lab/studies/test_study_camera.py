"""Camera timing and strength through the report, with the paper's printed counts and intervals."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import jsonschema
import pytest
from msgspec.structs import replace

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.writers.report_files import read_report, report_json
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import plain
from tests.report.studies.studied import Cell, cell, study_of

PRINTED = 0.0005 + 1e-9
"""Half a unit of the last printed decimal, as a share."""


XVLA = [
    cell("plus", "111", 10),
    cell("plus", "110", 2, stale=3),
    cell("plus", "101", 54, near=False),
    cell("plus", "101", 22),
    cell("plus", "100", 436),
    cell("plus", "001", 7, near=False),
    cell("plus", "000", 169, near=False),
    cell("pro", "111", 1),
    cell("pro", "101", 20, near=False),
    cell("pro", "101", 10),
    cell("pro", "100", 127, near=False),
    cell("pro", "000", 139, near=False),
    cell("pro", "000", 3),
]


@pytest.fixture(scope="module")
def report() -> Report:
    planned, records, provenance = study_of(XVLA, {"name": "camera-timing"})
    return build_report(records, [], planned, provenance)


def test_the_papers_rates_and_intervals(report: Report) -> None:
    printed = {"base": (682, 65.4, 71.0), "reset": (13, 0.6, 2.0), "dynamic": (124, 10.4, 14.5)}
    for arm, (count, lower, upper) in printed.items():
        rate = plain(report)["study"]["camera"]["rates"][arm]
        assert (rate["count"], rate["of"]) == (count, 1000)
        ends = (100 * rate["bootstrap"]["lower"], 100 * rate["bootstrap"]["upper"])
        assert ends == pytest.approx((lower, upper), abs=100 * PRINTED)
    by_source = {arm: rate["by_source"] for arm, rate in plain(report)["study"]["camera"]["rates"].items()}
    counts = {arm: [rates[source]["count"] for source in ("plus", "pro")] for arm, rates in by_source.items()}
    assert counts == {"base": [524, 158], "reset": [12, 1], "dynamic": [93, 31]}


@pytest.mark.parametrize("policy", ["pi05", "himem_wam"])
def test_the_papers_rates_and_intervals_of_other_policies(policy: str) -> None:
    tables = json.loads((Path(__file__).parents[2] / "stats" / "paper_tables.json").read_text())["camera"]
    printed = dict(zip(("base", "reset", "dynamic"), tables[policy].values(), strict=True))
    cells = [
        Cell(source, {arm: number < row[source] for arm, row in printed.items()}, 1)
        for source, cases in (("plus", 700), ("pro", 300))
        for number in range(cases)
    ]
    planned, records, provenance = study_of(cells, {"name": "camera-timing"})
    study = plain(build_report(records, [], planned, provenance))["study"]
    for arm, row in printed.items():
        rate = study["camera"]["rates"][arm]
        assert f"{100 * rate['value']:.1f}" == f"{row['rate']:.1f}"
        assert [f"{100 * rate['bootstrap'][end]:.1f}" for end in ("lower", "upper")] == [
            f"{end:.1f}" for end in row["interval"]
        ]
        assert {source: cell["count"] for source, cell in rate["by_source"].items()} == {
            source: row[source] for source in ("plus", "pro")
        }


def test_the_papers_contrast_of_mid_task_and_reset(report: Report) -> None:
    found = plain(report)["study"]["camera"]["contrasts"][0]
    assert (found["first"], found["second"]) == ("dynamic", "reset")
    assert (found["gains"], found["losses"]) == (113, 2)
    assert found["value"] == 0.111
    bootstrap = found["bootstrap"]
    assert (bootstrap["lower"], bootstrap["upper"]) == pytest.approx((0.092, 0.131), abs=PRINTED)
    assert found["by_source"]["plus"]["value"] == pytest.approx(0.116, abs=PRINTED)
    assert found["by_source"]["pro"]["value"] == pytest.approx(0.100, abs=PRINTED)
    assert found["lower"] < bootstrap["lower"]
    groups = found["by_groups"]
    assert (groups["reference_tasks"]["groups"], groups["reference_tasks"]["replicates"]) == (40, 50_000)
    assert (groups["source_tasks"]["groups"], groups["configurations"]["groups"]) == (80, 1000)
    for group in groups.values():
        assert 0.08 < group["lower"] < 0.111 < group["upper"] < 0.15


def test_the_papers_approach_counts(report: Report) -> None:
    approach = plain(report)["study"]["camera"]["approach"]["1"]
    assert {key: approach[key] for key in approach if key not in ("triggered", "query_after_the_event")} == {
        "reset_failed_never_entered": 516,
        "reset_failed_entered": 471,
        "reset_succeeded_never_entered": 0,
        "reset_succeeded_entered": 13,
        "lost_in_reset": 106,
        "lost_in_reset_never_entered": 74,
        "lost_in_middle": 2,
        "lost_in_middle_with_a_query": 2,
        "lost_in_middle_without_stale_actions": 0,
    }


def test_many_cases_need_no_warning(report: Report) -> None:
    assert "fewer than 30" not in markdown(report)


def test_joint_outcomes_add_up_to_the_cases(report: Report) -> None:
    rows = plain(report)["study"]["camera"]["outcomes"]
    assert sum(row["cases"] for row in rows) == 1000
    kept = next(row for row in rows if row["success"] == {"base": True, "reset": False, "dynamic": True})
    assert kept["cases"] == 106
    assert [row["cases"] for row in rows] == sorted((row["cases"] for row in rows), reverse=True)


def test_other_reports_stay_those_of_the_pair() -> None:
    cells = [cell("plus", "101", 6), cell("pro", "110", 4), cell("pro", "000", 2)]
    planned, records, provenance = study_of(cells, {"name": "camera-timing"})
    report = build_report(records, [], planned, provenance)
    without = build_report(records, [], planned, {**provenance, "protocol": {"prefix": "fork"}})
    assert without.study is not None
    assert list(without.study.arms or {}) == ["base", "dynamic", "reset"]
    assert replace(without, provenance={}, study=None) == replace(report, provenance={}, study=None)


# Himem-WAM lost 34 Base-and-Reset successes in Mid-task, 5 of them without a stale action.


def test_stale_actions_of_lost_cases() -> None:
    cells = [cell("plus", "110", 5, stale=0), cell("plus", "110", 29, stale=4), cell("pro", "111", 600)]
    planned, records, provenance = study_of(cells, {"name": "camera-timing"})
    study = plain(build_report(records, [], planned, provenance))["study"]
    approach, lost = study["camera"]["approach"]["1"], "lost_in_middle"
    counts = (approach[lost], approach[f"{lost}_with_a_query"], approach[f"{lost}_without_stale_actions"])
    assert counts == (34, 34, 5)


def seven(source: str, outcomes: str, count: int) -> Cell:
    """Base, then Reset and Mid-task at 25%, 50% and 100%."""
    names = ("base", "reset_25", "dynamic_25", "reset_50", "dynamic_50", "reset", "dynamic")
    return Cell(source, dict(zip(names, (letter == "1" for letter in outcomes), strict=True)), count)


def test_seven_outcomes_within_and_between_strengths() -> None:
    cells = [seven("plus", "1111111", 20), seven("plus", "1110101", 12), seven("pro", "1110100", 8)]
    cells += [seven("pro", "1010000", 5), seven("plus", "0000000", 5)]
    planned, records, provenance = study_of(cells, {"name": "camera-strength"})
    study = plain(build_report(records, [], planned, provenance))["study"]
    assert list(study["camera"]["conditions"].values()) == [
        "Base",
        "Reset 25%",
        "Mid-task 25%",
        "Reset 50%",
        "Mid-task 50%",
        "Reset 100%",
        "Mid-task 100%",
    ]
    counts = {arm: rate["count"] for arm, rate in study["camera"]["rates"].items()}
    assert counts == {
        "base": 45,
        "reset_25": 40,
        "dynamic_25": 45,
        "reset_50": 20,
        "dynamic_50": 40,
        "reset": 20,
        "dynamic": 32,
    }
    contrasts = {(row["first"], row["second"]): row for row in study["camera"]["contrasts"]}
    assert len(contrasts) == 9 + 6
    assert contrasts["dynamic_50", "reset_50"]["gains"] == 20
    assert contrasts["reset", "reset_25"]["losses"] == 20
    gaps = {(row["first"], row["second"]): row["value"] for row in study["camera"]["gap_contrasts"]}
    assert gaps == pytest.approx({("0.5", "0.25"): 0.3, ("1", "0.25"): 0.14, ("1", "0.5"): -0.16})
    assert list(study["camera"]["approach"]) == ["0.25", "0.5", "1"]


@pytest.mark.parametrize("name", ["camera-timing", "camera-strength"])
@pytest.mark.parametrize("cells", [[], [seven("plus", "1111111", 1)], [seven("pro", "1010000", 3)]])
def test_every_writer_prints_a_study_of_any_size(name: str, cells: list[Cell]) -> None:
    planned, records, provenance = study_of(cells, {"name": name})
    report = build_report(records, [], planned, provenance)
    schema = json.loads(
        resources.files("pytest_libero_max.report").joinpath("report.schema.json").read_text()
    )
    jsonschema.Draft202012Validator(schema).validate(plain(report))
    for text in (markdown(report), html(report, [], ["pytest"]), "\n".join(summary_lines(report))):
        assert ("Reset" in text) == bool(cells)
        assert ("fewer than 30" in text) == bool(cells)
    assert report.study is not None
    assert bool(study_figures(report.study)) == bool(cells)


def test_few_groups_decide_nothing() -> None:
    planned, records, provenance = study_of([cell("plus", "101", 12)], {"name": "camera-timing"})
    (contrast, *_) = plain(build_report(records, [], planned, provenance))["study"]["camera"]["contrasts"]
    assert contrast["bootstrap"]["degenerate"]
    assert contrast["lower"] < contrast["by_source"]["plus"]["value"] == 1.0
    assert contrast["by_source"]["plus"]["lower"] == contrast["lower"]
    assert contrast["by_groups"]["reference_tasks"]["lower"] is None


def test_an_unknown_study_and_a_missing_arm_are_named() -> None:
    planned, records, provenance = study_of([cell("plus", "101", 2)], {"name": "camera-timing"})
    with pytest.raises(ReportError, match="none that"):
        build_report(
            records, [], planned, {**provenance, "protocol": {"study": {"name": "weather", "settings": None}}}
        )
    with pytest.raises(ReportError, match="'reset_25'"):
        build_report(records, [], planned, {**provenance, "protocol": {"study": {"name": "camera-strength"}}})


def test_the_results_are_read_from_a_file_as_they_were_written(report: Report, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text(report_json(report))
    read = read_report(tmp_path)
    assert summary_lines(read) == summary_lines(report)
    assert report_json(read) == report_json(report)
    assert read.study is not None
    with pytest.raises(ReportError, match="camera-timing are damaged"):
        summary_lines(replace(read, study=replace(read.study, camera={**read.study.camera, "rates": 1})))
