"""The files of a finished run, computed from its ``pairs.jsonl`` and from nothing else."""

from __future__ import annotations

import json
from pathlib import Path

from pytest_libero_max.cases import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import (
    REPORT_NAME,
    REPORT_VERSION,
    rebuild_report,
    report_json,
    write_text,
)
from pytest_libero_max.report.markdown import markdown
from pytest_libero_max.report.store import PAIRS_NAME

MARKDOWN_NAME = "report.md"


def write_reports(folder: Path) -> tuple[Json, list[Path]]:
    """Compute the report of the run in ``folder`` and write it beside its pairs.

    Returns:
        The report, and every file of the run: the pairs, ``report.json`` and ``report.md``.

    Raises:
        ReportError: The pairs cannot be read, or the files not be written.
    """
    report = rebuild_report(folder)
    files = {REPORT_NAME: report_json(report), MARKDOWN_NAME: markdown(report)}
    for name, text in files.items():
        write_text(folder / name, text)
    return report, [folder / name for name in (PAIRS_NAME, *files)]


def read_report(path: Path) -> Json:
    """Read a ``report.json`` (or the one in a folder).

    Raises:
        ReportError: It is missing, is not a report, or is of another schema version.
    """
    if path.is_dir():
        path = path / REPORT_NAME
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ReportError(
            f"Cannot read {path}: {error}. Give a report.json or the folder of a run."
        ) from error
    version = report.get("schema_version") if isinstance(report, dict) else None
    if version != REPORT_VERSION:
        raise ReportError(
            f"{path} has schema_version={version!r}, but this version reads {REPORT_VERSION}. "
            "Compute it again from its pairs.jsonl."
        )
    return dict(report)
