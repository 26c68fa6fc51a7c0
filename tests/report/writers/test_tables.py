from __future__ import annotations

import csv
import io

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.formats import latex_escaped
from pytest_libero_max.report.run_tables import csv_text, latex_text
from pytest_libero_max.report.run_texts import title_text
from tests.report.made_up import PROVENANCE, plain, plan, records_of

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
