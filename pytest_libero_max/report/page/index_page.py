"""The page of several published runs: one static file, which any server of files serves."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from pytest_libero_max.report.formats import change_text, count_text, counted, rate_text
from pytest_libero_max.report.page.page_frame import page
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_index import DIGITS, IndexedRun, RunIndex
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.writers.report_files import MARKDOWN_NAME
from pytest_libero_max.report.writers.summary import policy_title, stopped_texts

HEAD = (
    "Policy", "Base success", "Dynamic success", "Paired change", "Base successes lost", "Event fired",
    "Notes", "Played with", "Fingerprint of the installation", "Digest of the pairs", "Verified",
)  # fmt: skip


class Cell(NamedTuple):
    """A cell of the table.

    Attributes:
        text: What it says.
        order: By which its column is sorted.
        link: Address that it leads to; empty for none.
        kind: Class of its text; empty for none.
    """

    text: str
    order: float | str
    link: str = ""
    kind: str = ""


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
    fired, taken = result.trigger_coverage, str(report.provenance.get("fingerprint") or "")
    return [
        Cell(
            policy_title(report), policy_title(report), quote(f"{_way(run.folder, beside)}/{MARKDOWN_NAME}")
        ),
        Cell(rate_text(result.base_success), _number(result.base_success.value)),
        Cell(rate_text(result.dynamic_success), _number(result.dynamic_success.value)),
        Cell(change_text(result.paired_change), _number(result.paired_change.value)),
        Cell(count_text(result.conditional_regression), _number(result.conditional_regression.value)),
        Cell(count_text(fired), _number(fired.value)),
        Cell(_notes(report), len(report.warnings)),
        Cell(run.versions, run.versions),
        Cell(taken or "not taken", taken),
        Cell(run.digest[:DIGITS], run.digest),
        _verified(run),
    ]


def _notes(report: Report) -> str:
    """Return what belongs beside the numbers of a run: its alarms in full, its caveats by name."""
    caveats = ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in report.caveats)
    stopped = stopped_texts(report.pairs)
    return " ".join([*report.warnings, *stopped, *([f"Notes on pairs: {caveats}."] if caveats else [])])


def _verified(run: IndexedRun) -> Cell:
    cases = "numbers and cases" if run.cases_checked else "numbers (cases of no frozen track)"
    again = run.again
    if again is None:
        return Cell(f"{cases}; no pair played again", 0)
    how = " from recorded actions" if again.actions else ""
    words = (
        f"{cases}; {again.pairs} {'pair' if again.pairs == 1 else 'pairs'} played again alike{how} on "
        f"{again.date} with MuJoCo {again.mujoco}, drawn by {again.seed!r}"
    )
    return Cell(words, again.pairs, kind="holds")


def _way(folder: Path, beside: Path) -> str:
    return Path(os.path.relpath(folder, beside)).as_posix()


def _number(value: float | None) -> float | str:
    return "" if value is None else value
