"""A number is declared once: one Quantity reaches every renderer, the CSV file and gates."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

import pytest

TITLE = "Ended before the next query"

SCRIPT = f"""
TITLE = {TITLE!r}
"""
SCRIPT += """
import json

from pytest_libero_max.report import quantities
from pytest_libero_max.report.formats import Number
from pytest_libero_max.report.quantities import Line, Quantity

declared = Quantity(
    "unanswered", TITLE, lambda row: row.stale_actions.unanswered, Number(),
    tables=("summary", "groups", "narrow"), line=Line("Unanswered"),
)
quantities.QUANTITIES = (*quantities.QUANTITIES, declared)

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.run_tables import csv_text, latex_text
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.report_files import report_json
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import PROVENANCE, plan, record_of

pairs = plan()
silent = {"response_step": None, "stale_actions": 72}
records = [record_of(pair, True, True, **(silent if place < 3 else {})) for place, pair in enumerate(pairs)]
report = build_report(records, [], pairs, PROVENANCE)
result = evaluate_gate(parse_gate("unanswered <= 2"), report)
print(json.dumps({
    "terminal": summary_lines(report),
    "markdown": markdown(report),
    "page": html(report, [], []),
    "csv": csv_text(report),
    "latex": latex_text(report),
    "json": report_json(report),
    "gate": [result.verdict, result.value],
    "of a group": evaluate_gate(parse_gate("source.plus.unanswered <= 5"), report).verdict,
}))
"""


@pytest.fixture(scope="module")
def written() -> Mapping[str, Any]:
    """Everything that is written of a run in which three pairs end before the next query."""
    run = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    texts: Mapping[str, Any] = json.loads(run.stdout)
    return texts


def test_a_quantity_that_is_declared_once_is_shown_everywhere(written: Mapping[str, Any]) -> None:
    assert f"{'Unanswered':<32}3" in written["terminal"]
    assert f"| {TITLE} | 3 |" in written["markdown"]
    assert f"<th scope='row'>{TITLE}</th><td>3</td>" in written["page"]
    assert f"<td data-title='{TITLE}'>3</td>" in written["page"]
    head, overall, *_ = written["csv"].splitlines()
    assert overall.split(",")[head.split(",").index("unanswered")] == "3"
    assert TITLE in written["latex"]
    assert json.loads(written["json"])["overall"]["stale_actions"]["unanswered"] == 3


def test_gates_can_ask_for_it(written: Mapping[str, Any]) -> None:
    assert written["gate"] == ["failed", 3]
    assert written["of a group"] == "passed"
