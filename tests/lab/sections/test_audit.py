"""What an audit says, from made-up records."""

from __future__ import annotations

import pytest

from pytest_libero_max.lab.sections.audit import TITLE, input_tables
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from tests.report.studies.studied import Cell, study_of

CELLS = (
    Cell("plus", {"base": True, "black_images": False, "paraphrase": True, "dynamic": True}, 12),
    Cell("pro", {"base": True, "black_images": True, "paraphrase": False, "dynamic": True}, 2),
    Cell("pro", {"base": False, "black_images": False, "paraphrase": True, "dynamic": True}, 1),
)


@pytest.fixture(scope="module")
def report() -> Report:
    planned, records, provenance = study_of(CELLS, {"name": "audit"})
    return build_report(records, [], planned, provenance)


def test_the_table_says_which_inputs_are_needed(report: Report) -> None:
    assert report.study is not None
    assert (report.study.by_event, report.study.contrasts) == (None, None)
    (table,) = input_tables(report)
    rows = {row[0]: row for row in table.texts()}
    assert rows["base"][2] == "14/15"
    assert rows["black_images"][1:3] == ["all images black", "2/15"]
    assert rows["black_images"][3].startswith("-80.0 pp [")
    assert rows["black_images"][4:] == ["12", "0", "9.8e-4", "needed"]  # 2 * 2**-12, adjusted for two arms
    assert rows["paraphrase"][4:] == ["2", "1", "1.000", "not shown to matter"]
    assert f"## {TITLE}\n\n| Arm | " in markdown(report)


@pytest.mark.parametrize(
    ("gate", "value"),
    [
        ("audit.black_images.change >= -50%", -0.8),
        ("audit.paraphrase.lost <= 3", 2),
        ("audit.base.success > 0", 14 / 15),
    ],
)
def test_gates_ask_for_its_numbers(report: Report, gate: str, value: float) -> None:
    assert evaluate_gate(parse_gate(gate), report).value == pytest.approx(value)
