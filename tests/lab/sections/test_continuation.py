"""Numbers of controllers that continue one prefix, from made-up records."""

from __future__ import annotations

import pytest
from msgspec import structs

from pytest_libero_max.lab.sections.continuation import TITLE
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.measures import measures_of
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import shown_sections
from tests.report.studies.studied import Cell, study_of

ARMS = (
    *("base", "dynamic", "dynamic_quick", "base_quick", "own_base_quick", "dynamic_quick_d4"),
    *("dynamic_slow", "base_slow", "own_base_slow", "dynamic_slow_d4", "dynamic_d4"),
)
CELLS = [
    Cell(source, {arm: end == "1" for arm, end in zip(ARMS, ends, strict=True)}, cases)
    for source, ends, cases in (("plus", "10111001100", 12), ("pro", "11001011001", 4))
]
HEADER = {"name": "continue", "settings": "quick,slow,own_base,4steps"}


@pytest.fixture(scope="module")
def report() -> Report:
    planned, records, provenance = study_of(CELLS, HEADER)
    return build_report(records, [], planned, provenance)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("run.success", 4 / 16),
        ("run.change", -12 / 16),
        ("quick.success", 12 / 16),
        ("quick.change", -4 / 16),
        ("quick.over_run", 8 / 16),
        ("quick.handed", 12 / 16),
        ("quick.handover", -4 / 16),
        ("quick.event", 0),
        ("quick.over_own_base", -4 / 16),
        ("slow.event", -12 / 16),
        ("slow.own_base", 12 / 16),
        ("quick_d4.success", 0),
        ("quick_d4.over_run", -4 / 16),
        ("run_d4.change", -12 / 16),
        ("quick.over_slow", 8 / 16),
    ],
)
def test_each_number_is_paired_by_case(report: Report, key: str, value: float) -> None:
    measure = measures_of(report.sections)[f"continue.{key}"]
    assert measure.value == value
    if measure.unit != "p":
        assert measure.lower is not None
        assert measure.upper is not None
        assert measure.lower <= value <= measure.upper


def test_a_gate_asks_for_the_numbers_of_a_controller(report: Report) -> None:
    assert evaluate_gate(parse_gate("continue.quick.over_run > 0"), report).passed
    assert not evaluate_gate(parse_gate("continue.slow.event.lower >= -20%"), report).passed
    assert evaluate_gate(parse_gate("continue.quick.p_over_slow <= 0.1"), report).passed
    assert evaluate_gate(parse_gate("continue.quick.over_run.lower > -50%"), report).verdict == "passed"
    assert evaluate_gate(parse_gate("continue.quick.over_slow.lower > -50%"), report).verdict == "passed"
    absent = evaluate_gate(parse_gate("continue.nobody.event >= 0"), report)
    assert absent.verdict == "undecidable"


def test_each_table_has_a_row_for_each_controller(report: Report) -> None:
    section = next(one for one in shown_sections(report) if any("event on" in it.title for it in one.tables))
    tables: dict[str, Table] = {table.title: table for table in section.tables}
    dynamic, handover, contrasts = tables.values()
    assert [row[0] for row in dynamic.texts()] == [
        *("scripted (run)", "quick", "slow"),
        *("scripted (run)_d4", "quick_d4", "slow_d4"),
    ]
    assert len(handover.head) == 6
    assert [row[0] for row in contrasts.texts()] == ["quick - slow"]
    assert "another policy produced" in markdown(report)


def test_pairs_without_an_event_are_left_out_and_counted() -> None:
    """There no controller takes over: its arm is Base of another policy, beside an own Base that succeeds."""
    planned, records, provenance = study_of(CELLS, HEADER)
    quiet = []
    for record in records[:3]:
        base = record.arms["base"]
        arms = {
            name: arm if name.startswith(("base", "own")) and name in ("base", "own_base_quick") else base
            for name, arm in record.arms.items()
        }
        shared = {name: structs.replace(arm, shares="base") for name, arm in arms.items() if arm is base}
        quiet.append(structs.replace(record, arms={**arms, **shared, "base": base}))
    report = build_report([*quiet, *records[3:]], [], planned, provenance)
    measures = measures_of(report.sections)
    assert measures["continue.pairs"].value == 13
    assert measures["continue.quick.success"].of == 13
    assert measures["continue.quick.own_base"].of == 13
    assert "13 of 16 pairs" in markdown(report)


def test_without_own_bases_there_is_no_number_of_them() -> None:
    further = [arm for arm in CELLS[0].success if "own" in arm or "d4" in arm]
    cells = [
        Cell(cell.source, {arm: end for arm, end in cell.success.items() if arm not in further}, cell.count)
        for cell in CELLS
    ]
    planned, records, provenance = study_of(cells, {"name": "continue", "settings": "quick,slow"})
    report = build_report(records, [], planned, provenance)
    assert not [key for key in measures_of(report.sections) if "own_base" in key]
    assert "Own Base" not in markdown(report)
    assert TITLE in report.sections
