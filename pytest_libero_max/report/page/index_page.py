"""The page of several published runs: one static file, which any server of files serves."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pytest_libero_max.report.document import Document, Link, Section, Table
from pytest_libero_max.report.formats import Format, counted
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.quantities import TEXT, Quantity, quantities_in, quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_index import DIGITS, IndexedRun, RunIndex
from pytest_libero_max.report.writers.report_files import MARKDOWN_NAME
from pytest_libero_max.report.writers.summary import policy_title, stopped_texts

_NUMBERS = (*quantities_in("runs"), quantity("trigger_coverage"))


class _Digest(Format):
    """The beginning of a digest; the whole of it is what a column is sorted by."""

    def long(self, value: str) -> str:
        return value[:DIGITS]


_WORDS: tuple[Quantity[IndexedRun], ...] = (
    Quantity("notes", "Notes", lambda run: _notes(run.report), TEXT),
    Quantity("versions", "Played with", lambda run: run.versions, TEXT),
    Quantity("fingerprint", "Fingerprint of the installation", lambda run: _fingerprint(run.report), TEXT),
    Quantity("digest", "Digest of the pairs", lambda run: run.digest, _Digest()),
    Quantity("verified", "Verified", lambda run: _verified(run), TEXT),
)


def index_html(index: RunIndex, beside: Path) -> str:
    """Render published runs as a page with a table for each set of cases.

    Args:
        index: The runs.
        beside: Folder of the page, from which its links lead to the runs.
    """
    scripts = ("sorting.js",) if index.groups else ()
    return document_page("document.html", index_document(index, beside), scripts=scripts)


def index_document(index: RunIndex, beside: Path) -> Document:
    """Return published runs as a document; see :func:`index_html`."""
    runs = [run for group in index.groups.values() for run in group]
    statements = {
        text: None for run in runs for text in (run.report.substrate.note, *run.report.statements.values())
    }
    verified = sum(run.again is not None for run in runs)
    head: list[str | Quantity[Any]] = ["Policy", *_NUMBERS, *_WORDS]
    return Document(
        counted(len(runs), "published run"),
        [f"Refused: {_way(folder, beside)}. {reason}" for folder, reason in index.refused],
        [
            f"{verified} of {len(runs)} verified: those who keep this page played pairs drawn at random "
            "again, and they ended alike. The numbers of every run here were computed again from its pairs."
        ],
        [
            Section(tables=[Table(title, head, [_row(run, beside) for run in group], sortable=True)])
            for title, group in index.groups.items()
        ],
        statements=[text for text in statements if text],
    )


def _row(run: IndexedRun, beside: Path) -> list[Any]:
    address = quote(f"{_way(run.folder, beside)}/{MARKDOWN_NAME}")
    numbers = [one.cell(run.report.overall) for one in _NUMBERS]
    return [Link(policy_title(run.report), address), *numbers, *(one.cell(run) for one in _WORDS)]


def _notes(report: Report) -> str:
    """Return what belongs beside the numbers of a run: its alarms in full, its caveats by name."""
    caveats = ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in report.caveats)
    stopped = stopped_texts(report.pairs)
    return " ".join([*report.warnings, *stopped, *([f"Notes on pairs: {caveats}."] if caveats else [])])


def _fingerprint(report: Report) -> str:
    return str(report.provenance.get("fingerprint") or "not taken")


def _verified(run: IndexedRun) -> str:
    cases = "numbers and cases" if run.cases_checked else "numbers (cases of no frozen track)"
    again = run.again
    if again is None:
        return f"{cases}; no pair played again"
    how = " from recorded actions" if again.actions else ""
    return (
        f"\N{CHECK MARK} {cases}; {counted(again.pairs, 'pair')} played again alike{how} on "
        f"{again.date} with MuJoCo {again.mujoco}, drawn by {again.seed!r}"
    )


def _way(folder: Path, beside: Path) -> str:
    return Path(os.path.relpath(folder, beside)).as_posix()
