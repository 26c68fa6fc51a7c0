"""An audit as a document: what one policy needs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pytest_libero_max.report.document import Document, Section
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.studies.study_tables import study_tables

_SAYS = {
    "needed": "It needs: with less of it, it succeeds less than in Base",
    "better without": "It succeeds more without",
    "no case differs": "Changed no case",
    "not shown to matter": "Not shown to matter with so many cases",
    "Base never succeeds": "Nothing is known, because Base never succeeds",
}
"""Beginnings of the sentences by verdict, the most important first."""


def audit_document(report: Report) -> Document:
    """Return the policy, what it needs in words, and the table.

    Args:
        report: Of a run of the study ``audit``, with a pair.
    """
    assert report.study is not None
    assert report.policy is not None
    (table,) = study_tables(report.study)
    policy = report.policy
    played = (
        f"{counted(report.study.cases, 'case')}; H={policy['horizon']}, Q={policy['query_interval']}; "
        f"cameras: {', '.join(policy['cameras']) or 'none'}."
    )
    reads = (
        "It reads the simulator (privileged): it can do without any of its inputs, and what follows says "
        "only which of them it uses besides."
    )
    return Document(
        f"Audit: what {policy['name']} needs",
        texts=[played, *([reads] if policy["privileged"] else [])],
        sections=[Section(items=[*_sentences(table.texts())]), Section(tables=[table])],
    )


def _sentences(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield one sentence for each verdict, with what was changed in its arms."""
    for verdict, says in _SAYS.items():
        arms = [f"{row[1]} ({row[2]})" for row in rows if row[-1] == verdict]
        if arms:
            yield f"{says}: {'; '.join(arms)}."
