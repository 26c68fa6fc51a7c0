"""A cadence sweep through the report."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema
import pytest
from msgspec.structs import replace

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.studies.study_tables import study_tables
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import plain
from tests.report.studies.studied import Cell, study_of

GR00T = {2: (490, 335), 4: (530, 386), 8: (554, 411), 12: (524, 426), 16: (529, 406)}
"""Successes of 800 in Base and Dynamic by Q = H, from the paper's percentages."""


def sweep(counts: dict[str, tuple[int, int]], cases: int, settings: str) -> Report:
    """The report of a sweep with so many successes in Base and Dynamic, by the end of the arms' names."""
    cells = []
    for number in range(cases):
        success: dict[str, bool] = {}
        for end, (base, dynamic) in counts.items():
            success |= {f"base{end}": number < base, f"dynamic{end}": number < dynamic}
        cells.append(Cell("plus" if number % 10 < 7 else "pro", success, 1))
    planned, records, provenance = study_of(cells, {"name": "cadence", "settings": settings})
    records = [
        replace(record, policy={**record.policy, "horizon": 16, "query_interval": 16}) for record in records
    ]
    return build_report(records, [], planned, provenance)


@pytest.fixture(scope="module")
def report() -> Report:
    counts = {"" if q == 16 else f"_h{q}q{q}": successes for q, successes in GR00T.items()}
    return sweep(counts, 800, "2/2,4/4,8/8,12/12,16/16")


def test_rates_and_changes_of_every_setting(report: Report) -> None:
    settings = plain(report)["study"]["settings"]
    assert [setting["label"] for setting in settings] == [f"H={q} Q={q}" for q in GR00T]
    assert [setting["own"] for setting in settings] == [False, False, False, False, True]
    for setting, (base, dynamic) in zip(settings, GR00T.values(), strict=True):
        assert setting["base_success"]["count"] == base
        assert setting["dynamic_success"]["count"] == dynamic
        change = setting["paired_change"]
        assert change["value"] == (dynamic - base) / 800
        assert (
            change["lower"] <= change["bootstrap"]["by_source"]["lower"] < change["value"] < change["upper"]
        )
        assert setting["stale_actions"]["median"] == 2


def test_the_best_settings_are_those_the_paper_names(report: Report) -> None:
    best = plain(report)["study"]["best"]
    assert best["base_success"]["setting"] == "H=8 Q=8"
    assert best["dynamic_success"]["setting"] == "H=12 Q=12"
    own = plain(report)["study"]["settings"][3]["dynamic_success"]
    assert best["dynamic_success"]["lower"] < own["lower"]  # it was chosen
    assert best["dynamic_success"]["upper"] > own["upper"]


def test_of_equal_settings_none_is_the_best() -> None:
    report = sweep({"": (2, 1), "_q2": (2, 1)}, 3, "2")
    assert report.study is not None
    tables = {table.title: table.texts() for table in study_tables(report.study)}
    for part in ("Base", "Dynamic"):
        assert [row[2] for row in tables[f"Highest success in {part}"]] == ["equal highest"] * 2
    assert "-0.0" not in "\n".join(summary_lines(report))


def test_where_no_case_succeeds_no_setting_is_the_best() -> None:
    report = sweep({"": (2, 0), "_q2": (1, 0)}, 3, "2")
    assert report.study is not None
    (highest,) = (table for table in study_tables(report.study) if table.title.startswith("Highest"))
    assert [row[2] == "best" for row in highest.texts()] == [True, False]


def test_the_own_setting_is_the_reference_and_the_note_explains_what_is_there() -> None:
    report = sweep({"": (2, 1), "_q2": (1, 1)}, 3, "2")
    assert report.study is not None
    table = study_tables(report.study)[0]
    (own,) = (row for row in table.texts() if row[0].endswith("(own)"))
    assert own.count("reference") == 2
    assert "Q: actions" in table.note
    for absent in ("Waiting", "d: control", "goes on from the event"):
        assert absent not in table.note


def test_settings_that_are_not_shown_to_be_worse() -> None:
    study = plain(sweep({"": (20, 10), "_q2": (19, 9), "_q8": (20, 2)}, 24, "2,8"))["study"]
    best = study["best"]["dynamic_success"]
    assert best["setting"] == "H=16 Q=16"
    assert best["not_worse"] == ["H=16 Q=2"]
    assert best["differences"]["H=16 Q=8"]["value"] == pytest.approx(8 / 24)
    assert best["differences"]["H=16 Q=8"]["lower"] > 0


@pytest.mark.parametrize("cases", [0, 1, 3])
def test_every_writer_prints_a_sweep_of_any_size(cases: int) -> None:
    report = sweep({"": (1, 1), "_q2": (1, 0), "_h8q4": (0, 0)}, cases, "2,8/4")
    schema = json.loads(
        resources.files("pytest_libero_max.report").joinpath("report.schema.json").read_text()
    )
    jsonschema.Draft202012Validator(schema).validate(plain(report))
    for text in (markdown(report), html(report, [], ["pytest"]), "\n".join(summary_lines(report))):
        assert ("H=8 Q=4" in text) == bool(cases)
    assert report.study is not None
    assert list(study_figures(report.study)) == (["cadence"] if cases else [])
