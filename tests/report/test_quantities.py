from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.formats import IntervalByTask, latex_escaped
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.quantities import QUANTITIES, Quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_tables import csv_text, latex_text
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, plan, record_of, records_of

PAIRS = plan()
REPORT = build_report(records_of(PAIRS), [], PAIRS, PROVENANCE)
REPORTS: dict[str, Report] = {
    "full": REPORT,
    "alike": build_report(
        [record_of(pair, False, False, **NEVER_TRIGGERED) for pair in PAIRS], [], PAIRS, PROVENANCE
    ),
    "empty": build_report([], [], PAIRS, PROVENANCE),
}
UNANSWERED = build_report(
    [*records_of(PAIRS)[:-1], record_of(PAIRS[-1], True, True, **NEVER_TRIGGERED)], [], PAIRS, PROVENANCE
)
ASKED = [column for column in QUANTITIES if column.gate is not None]


def _name(column: Quantity[Any]) -> str:
    return column.gate or column.key


def test_no_two_columns_share_a_name() -> None:
    for names in ([column.key for column in QUANTITIES], [_name(column) for column in ASKED]):
        assert len(set(names)) == len(names)


@pytest.mark.parametrize("column", QUANTITIES, ids=lambda column: column.key)
def test_a_column_stands_in_every_file_it_names(column: Quantity[Any]) -> None:
    overall = REPORT.overall
    row = next(csv.DictReader(io.StringIO(csv_text(REPORT))))
    for name, number in column.numbers(overall).items():
        assert row[name] == ("" if number is None else str(number))
    if "summary" in column.tables:
        line = f"<th scope='row'>{column.title}</th><td>{column.long(overall)}</td>"
        lacks_tasks = isinstance(column.format, IntervalByTask)  # which one note says of all of them
        stands = not lacks_tasks
        assert (f"| {column.title} | {column.long(overall)} |" in markdown(REPORT)) is stands
        assert html(REPORT, [], []).count(line) == stands
        assert markdown(REPORT).count("too few tasks (1 of 30") == 1
    for table in {"coverage", "given_response"} & {*column.tables}:
        shown = column.title if table == "coverage" else column.short_heading
        cell = f"<td data-title='{shown}'>{column.long(UNANSWERED.overall)}</td>"
        assert cell in html(UNANSWERED, [], [])
    if "narrow" in column.tables:
        assert f" {latex_escaped(column.short_heading)} " in latex_text(REPORT)
        assert column.format.latex(column.value(overall)) in latex_text(REPORT)
    if column.line is not None:
        text = column.short(overall) if column.line.short else column.long(overall)
        lines = [line for line in summary_lines(REPORT) if line.startswith(f"{column.line.title:<32}")]
        if column.line.optional and None in column.numbers(overall).values():
            assert lines == []
        else:
            assert f"{column.line.mark} {text}".strip() in lines[0]


@pytest.mark.parametrize("column", ASKED, ids=_name)
def test_a_gate_can_ask_for_every_column_that_is_a_number(column: Quantity[Any]) -> None:
    ends = ("", ".lower", ".upper") if column.format.has_interval else ("",)
    for end in ends:
        gate = parse_gate(f"event.camera_shift.{_name(column)}{end} > 0")
        expected = column.numbers(REPORT.by["event"]["camera_shift"])
        assert evaluate_gate(gate, REPORT).value == expected[column.key + end.replace(".", "_")]


@pytest.mark.parametrize("column", QUANTITIES, ids=lambda column: column.key)
@pytest.mark.parametrize("name", REPORTS)
def test_a_cell_exists_without_a_number(column: Quantity[Any], name: str) -> None:
    row = REPORTS[name].overall
    for text in (column.long(row), column.short(row), column.format.latex(column.value(row))):
        assert text
        assert "None" not in text
        assert "nan" not in text.lower()
    ends = set(column.format.numbers(column.value(row)))
    assert ({"_lower", "_upper"} <= ends) == column.format.has_interval
    assert column.gate is None or "" in ends


def test_the_terminal_has_one_row_an_event_in_columns_that_line_up() -> None:
    lines = summary_lines(REPORT)
    start = next(number for number, line in enumerate(lines) if line.startswith("Event  "))
    table = lines[start : start + 9]
    assert len({len(line) for line in table}) == 1
