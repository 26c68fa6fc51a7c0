"""The page of several published runs: one static file, which any server of files serves."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pytest_libero_max.lab.index.run_index import DIGITS, IndexedRun, RunIndex
from pytest_libero_max.report.document import Document, Link, Section, Table
from pytest_libero_max.report.formats import Format, counted
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.quantities import TEXT, Quantity, quantities_in, quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_texts import policy_title, stopped_texts
from pytest_libero_max.report.writers.report_files import MARKDOWN_NAME
from pytest_libero_max.runs.provenance import commit_text

_NUMBERS = (*quantities_in("runs"), quantity("trigger_coverage"))


_DAY = len("2026-01-31")


class _Digest(Format):
    """The beginning of a digest; the whole of it is what a column is sorted by."""

    def long(self, value: str) -> str:
        return value[:DIGITS]


_OVERVIEW = (*quantities_in("runs"),)

_ALL_NOTE = "Compare runs of the same cases alone: each set of cases has a table of its own below."

_WORDS: tuple[Quantity[IndexedRun], ...] = (
    Quantity("authors", "Authors", lambda run: run.about.authors, TEXT),
    Quantity("model", "Model", lambda run: _model(run), TEXT),
    Quantity("date", "Played on", lambda run: _date(run.report), TEXT),
    Quantity("commit", "Commit", lambda run: _commit(run.report), TEXT),
    Quantity("revision", "Revision of the policy", lambda run: _revision(run.report), TEXT),
    Quantity("versions", "Played with", lambda run: run.versions, TEXT),
    Quantity("digest", "Digest of the pairs", lambda run: run.digest, _Digest()),
    Quantity("verified", "Verified", lambda run: _verified(run), TEXT),
)


def index_html(index: RunIndex, beside: Path) -> str:
    """Render published runs as a page with a table for each set of cases.

    Args:
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
    return Document(
        counted(len(runs), "published run"),
        [f"Refused: {_way(folder, beside)}. {reason}" for folder, reason in index.refused],
        [
            f"{verified} of {len(runs)} verified: those who keep this page played pairs drawn at random "
            "again, and they ended alike. The numbers of every run here were computed again from its pairs."
        ],
        [
            *([Section("All runs", [_overview(index, beside)])] if runs else []),
            *(Section(title, [_table(group, beside)], folded=True) for title, group in index.groups.items()),
        ],
        statements=[text for text in statements if text],
    )


def _overview(index: RunIndex, beside: Path) -> Table:
    """Return the rates of all runs, those of the same cases together."""
    rows = [
        [_link(run, beside), title, *(one.cell(run.report.overall) for one in _OVERVIEW), _date(run.report)]
        for title, group in index.groups.items()
        for run in group
    ]
    head: list[str | Quantity[Any]] = ["Policy", "Cases", *_OVERVIEW, "Played on"]
    return Table("", head, rows, _ALL_NOTE, sortable=True)


def _table(runs: Sequence[IndexedRun], beside: Path) -> Table:
    """Return the runs of a set of cases. A column in which no run has a word is left out.

    A note that all of them have stands below.
    """
    notes = [_notes(run.report) for run in runs]
    shared = [note for note in notes[0] if all(note in others for others in notes)]
    own = [" ".join(note for note in of_run if note not in shared) for of_run in notes]
    words = [one for one in _WORDS if any(one.value(run) for run in runs)]
    head: list[str | Quantity[Any]] = ["Policy", *_NUMBERS, *words, *(["Notes"] if any(own) else [])]
    rows = [
        [
            _link(run, beside),
            *(one.cell(run.report.overall) for one in _NUMBERS),
            *(one.cell(run) for one in words),
            *([note] if any(own) else []),
        ]
        for run, note in zip(runs, own, strict=True)
    ]
    return Table("", head, rows, " ".join(shared), sortable=True)


def _link(run: IndexedRun, beside: Path) -> Link:
    return Link(policy_title(run.report), quote(f"{_way(run.folder, beside)}/{MARKDOWN_NAME}"))


def _notes(report: Report) -> list[str]:
    """Return what belongs beside the numbers of a run: its alarms in full, its caveats by name."""
    caveats = ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in report.caveats)
    caveat_notes = [f"Notes on pairs: {caveats}."] if caveats else []
    return [*report.warnings, *stopped_texts(report.pairs), *caveat_notes]


def _model(run: IndexedRun) -> str:
    """Return a link to the page of the model, named by its host and path; empty where none is stated."""
    address = run.about.model
    return Link(address.partition("://")[2].rstrip("/"), address) if address else ""


def _date(report: Report) -> str:
    return str(report.provenance.get("started") or "")[:_DAY]


def _commit(report: Report) -> str:
    git = report.provenance.get("git")
    return "" if git is None else commit_text(git)


def _revision(report: Report) -> str:
    return "" if report.policy is None else str(report.policy.get("revision") or "")


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
