"""What an audit says, from made-up records."""

from __future__ import annotations

import pytest

from pytest_libero_max.lab.sections.audit import TITLE, audit_document, input_tables
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of
from tests.report.studies.studied import Cell, study_of


def audited(privileged: bool) -> Report:
    """The report of a made-up audit: without images nothing succeeds, without the state everything does."""
    pairs = plan()
    success = {"black_images": False, "no_state": True}
    records = []
    for pair in pairs:
        record = record_of(pair, True, True, policy={**POLICY, "privileged": privileged})
        base = record.to_dict()
        arms = base["arms"]
        for name, succeeds in success.items():
            arms[name] = {**arms["base"], "success": succeeds}
        records.append(type(record).from_dict(base))
    protocol = {**PROVENANCE["protocol"], "study": {"name": "audit"}}
    return build_report(records, [], pairs, {**PROVENANCE, "protocol": protocol})


def test_the_page_says_what_is_needed() -> None:
    lines = document_markdown(audit_document(audited(privileged=False))).splitlines()
    assert lines[0] == "# Audit: what scripted needs"
    assert "- It needs: with less of it, it succeeds less than in Base: all images black (0/32)." in lines
    assert "- Changed no case: robot state of zeros (32/32)." in lines
    assert not any("simulator (privileged): it can do" in line for line in lines)


def test_the_page_of_a_policy_that_reads_the_simulator_says_so() -> None:
    assert "It reads the simulator (privileged)" in document_markdown(
        audit_document(audited(privileged=True))
    )


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
