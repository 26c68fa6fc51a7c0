"""The page of several published runs: one static file, which any server of files serves."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.page.page_frame import page
from pytest_libero_max.report.quantities import quantities_in, quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_index import DIGITS, IndexedRun, RunIndex
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.writers.report_files import MARKDOWN_NAME
from pytest_libero_max.report.writers.summary import policy_title, stopped_texts

_SHOWN = (*quantities_in("runs"), quantity("trigger_coverage"))

HEAD = (
    "Policy", *(one.title for one in _SHOWN),
    "Notes", "Played with", "Fingerprint of the installation", "Digest of the pairs", "Verified",
)  # fmt: skip


class IndexCell(NamedTuple):
    """A cell of the table."""

    text: str
    """What it says."""
    order: float | str
    """By which its column is sorted."""
    link: str = ""
    """Address that it leads to; empty for none."""
    kind: str = ""
    """Class of its text; empty for none."""


def index_html(index: RunIndex, beside: Path) -> str:
    """Render published runs as a page with a table for each set of cases.

    Args:
        index: The runs.
        beside: Folder of the page, from which its links lead to the runs.
    """
    runs = [run for group in index.groups.values() for run in group]
    statements = {
        text: None for run in runs for text in (run.report.substrate.note, *run.report.statements.values())
    }
    verified = sum(run.again is not None for run in runs)
    return page(
        "index.html",
        counted(len(runs), "published run"),
        None,
        scripts=("sorting.js",) if runs else (),
        verified=f"{verified} of {len(runs)} verified: those who keep this page played pairs drawn at random "
        "again, and they ended alike. The numbers of every run here were computed again from its pairs.",
        head=HEAD,
        groups=[(title, [_row(run, beside) for run in group]) for title, group in index.groups.items()],
        refused=[(_way(folder, beside), reason) for folder, reason in index.refused],
        limits_title=LIMITS_TITLE,
        statements=[text for text in statements if text],
    )


def _row(run: IndexedRun, beside: Path) -> Sequence[Any]:
    result, report = run.report.overall, run.report
    taken = str(report.provenance.get("fingerprint") or "")
    return [
        IndexCell(
            policy_title(report), policy_title(report), quote(f"{_way(run.folder, beside)}/{MARKDOWN_NAME}")
        ),
        *(IndexCell(one.long(result), _number(one.format.numbers(one.value(result))[""])) for one in _SHOWN),
        IndexCell(_notes(report), len(report.warnings)),
        IndexCell(run.versions, run.versions),
        IndexCell(taken or "not taken", taken),
        IndexCell(run.digest[:DIGITS], run.digest),
        _verified(run),
    ]


def _notes(report: Report) -> str:
    """Return what belongs beside the numbers of a run: its alarms in full, its caveats by name."""
    caveats = ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in report.caveats)
    stopped = stopped_texts(report.pairs)
    return " ".join([*report.warnings, *stopped, *([f"Notes on pairs: {caveats}."] if caveats else [])])


def _verified(run: IndexedRun) -> IndexCell:
    cases = "numbers and cases" if run.cases_checked else "numbers (cases of no frozen track)"
    again = run.again
    if again is None:
        return IndexCell(f"{cases}; no pair played again", 0)
    how = " from recorded actions" if again.actions else ""
    words = (
        f"{cases}; {again.pairs} {'pair' if again.pairs == 1 else 'pairs'} played again alike{how} on "
        f"{again.date} with MuJoCo {again.mujoco}, drawn by {again.seed!r}"
    )
    return IndexCell(words, again.pairs, kind="holds")


def _way(folder: Path, beside: Path) -> str:
    return Path(os.path.relpath(folder, beside)).as_posix()


def _number(value: float | None) -> float | str:
    return "" if value is None else value
