"""Several runs in their order, for example of checkpoints: what each loses, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pytest_libero_max.report.comparison.comparison_document import ComparedRun, Comparison
from pytest_libero_max.report.comparison.comparison_sections import RUNS, document_of
from pytest_libero_max.report.diagnosis import changed_pairs
from pytest_libero_max.report.document import Document, Section, Table
from pytest_libero_max.report.formats import change_text, counted, interval_text, percent, points
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.plots import COLOURS_NOTE, Plot, change_plot, change_row, direction, rates_row
from pytest_libero_max.report.quantities import Quantity, quantity
from pytest_libero_max.runs.store import read_pairs

Causes = Sequence[Counter[str]]
"""For each run the number of its regressions by cause."""

_NAMED = 3
"""Number of causes that the terminal shows; the CSV has all."""

_COUNTS = tuple(map(quantity, ("preserved_success", "change_associated_success", "regression")))


def causes_of(folder: Path, cases: Collection[str]) -> Counter[str]:
    """Count the causes of the regressions of a run among some cases, by item id."""
    changed = changed_pairs(record for record in read_pairs(folder).records if record.item_id in cases)
    return Counter(pair.cause for pair in changed if pair.outcome == "regression")


def trend_of(comparison: Comparison, causes: Causes) -> Document:
    """Return runs in their order as a document, on the cases that all have measured."""
    common = counted(comparison.pairs.common, "common case")
    names = [*_numbered(comparison)]
    all_causes = [cause for cause, _ in _ordered(sum(causes, Counter()))]
    lost = [(name, *(own[cause] for cause in all_causes)) for name, own in zip(names, causes, strict=True)]
    head = ("Run", *(cause.replace("_", " ") for cause in all_causes))
    alone = (
        "The 95% intervals are of each run alone. libero-max compare has the paired contrasts of two runs."
    )
    return replace(
        document_of(comparison),
        title=f"Trend of {counted(len(names), 'run')} on {common}",
        sections=[
            Section("Runs", [_table(comparison, names, RUNS).explaining_intervals(alone)]),
            Section("Causes of what was lost", [Table("", head, lost)]),
        ],
    )


def trend_table(comparison: Comparison, causes: Causes, *, whole: bool) -> Table:
    """Return one table of rates and causes: with all counts for a file, or with the first causes in words."""
    names = [run.name for run in comparison.runs]
    table = _table(comparison, names, (*RUNS, *_COUNTS) if whole else RUNS)
    if not whole:
        words = [", ".join(f"{cause} {count}" for cause, count in _ordered(own)[:_NAMED]) for own in causes]
        return _widened(table, ["Causes of what was lost"], [[text] for text in words])
    all_causes = sorted(sum(causes, Counter()))
    return _widened(table, all_causes, [[own[cause] for cause in all_causes] for own in causes])


def _table(comparison: Comparison, names: Sequence[str], quantities: Sequence[Quantity[Any]]) -> Table:
    rows = [
        (name, *(one.cell(run) for one in quantities))
        for name, run in zip(names, comparison.runs, strict=True)
    ]
    return Table("", ("Run", *quantities), rows)


def _widened(table: Table, head: Sequence[str], cells: Sequence[Sequence[str | int]]) -> Table:
    rows = [(*row, *more) for row, more in zip(table.rows, cells, strict=True)]
    return replace(table, head=(*table.head, *head), rows=rows)


def _ordered(causes: Counter[str]) -> list[tuple[str, int]]:
    return sorted(causes.items(), key=lambda item: (-item[1], item[0]))


def success_by_run(comparison: Comparison) -> Plot:
    """Return success in Base and Dynamic by run."""
    rows = [
        rates_row(name, "", run.base_success.value, run.dynamic_success.value, _rates(run))
        for name, run in _numbered(comparison).items()
    ]
    title = f"Success on {counted(comparison.pairs.common, 'common case')}"
    return Plot(title, ("Run", "Base to Dynamic"), rows, signed=False)


def change_by_run(comparison: Comparison) -> Plot:
    """Return the paired change by run, with its interval."""
    rows = [
        change_row(name, "", run.paired_change, change_text(run.paired_change))
        for name, run in _numbered(comparison).items()
    ]
    return change_plot("Paired change by run", "Run", rows)


def _rates(run: ComparedRun) -> str:
    return f"{percent(run.base_success.value)} to {percent(run.dynamic_success.value)}"


def _numbered(comparison: Comparison) -> dict[str, ComparedRun]:
    return {f"{number} {run.name}": run for number, run in enumerate(comparison.runs, 1)}


def trend_html(comparison: Comparison, causes: Causes) -> str:
    """Render runs as a page: the last run against the first, all runs, and the causes of what each lost."""
    first, last = comparison.runs[0].name, comparison.runs[-1].name
    contrast = next(row for row in comparison.contrasts if (row.first, row.second) == (first, last))
    difference = contrast.difference
    kind = direction(difference)
    if difference.lower is None:
        verdict = f"A rule stopped one of these runs, so that no difference of {last} from {first} is shown."
    else:
        verdict = {
            "loss": f"{last}, the last run, succeeds less often than {first} when the event happens.",
            "gain": f"{last}, the last run, succeeds more often than {first} when the event happens.",
            "neutral": f"No difference between {first}, the first run, and {last}, the last, is shown.",
        }[kind]
    return document_page(
        "trend.html",
        trend_of(comparison, causes),
        verdict=verdict,
        direction=kind,
        difference=f"{points(difference.value)} pp",
        interval=interval_text(difference, signed=True),
        plots=[change_by_run(comparison), success_by_run(comparison)],
        colours_note=COLOURS_NOTE,
    )
