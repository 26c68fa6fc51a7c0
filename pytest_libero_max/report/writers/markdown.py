"""The report as Markdown, for a repository or a pull request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pytest_libero_max.report.gate_rows import GateRow
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import run_document


def markdown(report: Report, films: Mapping[str, str] | None = None, gates: Sequence[GateRow] = ()) -> str:
    """Render a report; see :func:`.run_document`."""
    return document_markdown(run_document(report, films, gates))
