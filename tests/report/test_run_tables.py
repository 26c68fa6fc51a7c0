from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.cli import main
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.formats import latex_escaped, percent, points
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_tables import csv_text, latex_text, main_numbers
from pytest_libero_max.report.run_texts import title_text
from pytest_libero_max.report.writers.badge import badge_json
from tests.report.made_up import PROVENANCE, plain, plan, record_of, records_of, run_of, write_run

PLAN = plan()


def _report(played: int = len(PLAN), provenance: Json = PROVENANCE) -> Report:
    records = [record_of(pair, True, number % 4 > 0) for number, pair in enumerate(PLAN[:played])]
    return build_report(records, [], PLAN, provenance)


def test_the_main_numbers_are_those_of_the_report() -> None:
    report = _report()
    numbers = main_numbers(report)
    assert numbers["pairs/played"] == 32
    assert numbers["outcomes/regression"] == 8
    assert numbers["dynamic_success"] == 0.75
    assert numbers["paired_change"] == -0.25
    assert numbers["paired_change_lower"] == plain(report)["overall"]["paired_change"]["lower"]
    assert numbers["events/illumination_switch/dynamic_success"] == 0.5
    assert all(type(value) in (int, float) for value in numbers.values())


def test_an_incomplete_run_has_counts_and_no_rates() -> None:
    numbers = main_numbers(_report(played=30))
    assert numbers["pairs/missing"] == 2
    assert all(name.startswith(("pairs/", "outcomes/")) for name in numbers)


def test_a_badge_says_what_was_measured_on_what() -> None:
    assert json.loads(badge_json(_report())) == {
        "schemaVersion": 1,
        "label": "LIBERO-MAX smoke, embedded",
        "message": "Base 100.0%, Dynamic 75.0%",
        "color": "14708a",
    }
    assert json.loads(badge_json(_report(played=3)))["message"] == "incomplete"
    part = Selection.choose((pair.case_id for pair in PLAN), 800, ["-k light"], None)
    badge = json.loads(badge_json(_report(provenance={**PROVENANCE, "selection": part.to_dict()})))
    assert badge["label"] == "LIBERO-MAX 32 of 800 of smoke, embedded"


def test_a_badge_is_written_with_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_run(tmp_path, run_of(PLAN[:2], (record_of(pair, True, True) for pair in PLAN[:2])))
    assert main(["report", str(tmp_path), "--badge"]) == 0
    assert str(tmp_path / "badge.json") in capsys.readouterr().out
    assert json.loads((tmp_path / "badge.json").read_text())["message"] == "Base 100.0%, Dynamic 100.0%"


def test_ties_are_rounded_away_from_zero_as_in_the_paper() -> None:
    assert [percent(count / 8000) for count in (3452, 3460, 0, 8000)] == ["43.2%", "43.3%", "0.0%", "100.0%"]
    assert [points(count / 8000) for count in (-1540, 1540, 4, 0)] == ["-19.3", "+19.3", "+0.1", "+0.0"]


PAIRS = plan()
REPORT = build_report(records_of(PAIRS), [], PAIRS, PROVENANCE)
EMPTY = build_report([], [], PAIRS, PROVENANCE)


def test_csv_has_the_run_and_every_group_once() -> None:
    rows = list(csv.DictReader(io.StringIO(csv_text(REPORT))))
    groups = [row for row in rows if row["dimension"] in ("overall", *plain(REPORT)["by"])]
    assert len(groups) == 1 + sum(len(groups) for groups in plain(REPORT)["by"].values())
    assert len({(row["dimension"], row["group"]) for row in rows}) == len(rows)
    overall = plain(REPORT)["overall"]
    assert float(rows[0]["dynamic_success"]) == overall["dynamic_success"]["value"]
    assert int(rows[0]["regression"]) == overall["outcomes"]["regression"]
    assert float(rows[0]["paired_change_lower"]) == overall["paired_change"]["lower"]


def test_what_does_not_exist_is_an_empty_cell() -> None:
    row = next(csv.DictReader(io.StringIO(csv_text(EMPTY))))
    assert row["played"] == "0"
    assert row["base_success"] == row["stale_mean"] == row["log10_p_value"] == ""


def test_latex_escapes_and_ends_with_the_whole_run() -> None:
    text = latex_text(REPORT)
    title, unit, note, *_ = text.splitlines()
    assert title == f"% {title_text(REPORT)}"
    assert r"95\%" in unit
    assert note == f"% {latex_escaped(REPORT.substrate.note or '')}"
    assert r"camera\_shift & 4 & " in text
    assert text.index("All pairs & 32 &") > text.index(r"obstacle\_insertion")
    assert text.count(r"\\") == 10
    assert "nan" not in text.lower()


def test_latex_marks_what_is_incomplete() -> None:
    assert "All pairs & 0 of 32 & -- & -- & -- & --" in latex_text(EMPTY)
