from __future__ import annotations

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.studies.audit import audit_document
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of


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
