"""A report as CSV for spreadsheets, LaTeX for papers, and flat names for experiment trackers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from msgspec.structs import asdict

from pytest_libero_max.report.document import Table, table_of
from pytest_libero_max.report.formats import Number
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.measures import MEASURE, measures_of
from pytest_libero_max.report.probe_means import probe_quantities
from pytest_libero_max.report.quantities import QUANTITIES, TEXT, Cell, Quantity, quantities_in
from pytest_libero_max.report.render.tables import table_csv, table_latex
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_texts import title_text
from pytest_libero_max.report.sections import main_measures
from pytest_libero_max.stats.blocks import Change, Measure, Rate, Result

ALL_PAIRS = "overall"


def csv_text(report: Report) -> str:
    """Return a row for the run and every group, one column or three (estimate and interval) a quantity.

    After the groups come the unweighted mean over source categories (``macro``), for every source the
    category of lowest Base success and of largest loss, and the two variants of the largest split.

    Rates are fractions; a value that does not exist is empty.
    """
    quantities = (*QUANTITIES, *probe_quantities([report.overall]), *_of_sections(report))
    return table_csv(Table("", ("dimension", "group", *quantities), [*_rows(report, quantities)]))


def _of_sections(report: Report) -> Iterator[Quantity[Any]]:
    """Yield the numbers of sections, which are of all pairs and of no group."""
    measures = measures_of(report.sections)
    for key in measures:

        def value(row: Result, key: str = key) -> Measure | None:
            return measures[key] if row is report.overall else None

        yield Quantity(key, key, value, MEASURE, tables=())


def _rows(report: Report, quantities: Sequence[Quantity[Any]]) -> Iterator[Sequence[Any]]:
    results = {(ALL_PAIRS, ALL_PAIRS): report.overall}
    results |= {(name, group): row for name in DIMENSIONS for group, row in report.by[name].items()}
    for (dimension, group), row in results.items():
        yield dimension, group, *(one.cell(row) for one in quantities)
    macro = asdict(report.macro.category)
    means = (Cell(macro[one.key], Number("")) if one.key in macro else Cell(None, TEXT) for one in quantities)
    yield "macro", "category", *means
    for source, extremes in report.extremes.items():
        for what, group in asdict(extremes).items():
            yield f"{what}.{source}", group, *(one.cell(report.by["category"][group]) for one in quantities)
    if report.largest_split is not None:
        event = report.largest_split.event
        for variant in report.largest_split.dynamic_success:
            row = report.by["variant"][f"{event}-{variant}"]
            yield "largest_split", f"{event}-{variant}", *(one.cell(row) for one in quantities)


def latex_text(report: Report) -> str:
    """Return a ``tabular`` of the events in percent and percentage points, the whole run as its last row."""
    rows = [*report.by["event"].items(), ("All pairs", report.overall)]
    table = table_of("", DIMENSIONS["event"].title, quantities_in("narrow"), rows, apart=len(rows) - 1)
    with_intervals = " with their 95% intervals" if report.pairs.has_intervals else ""
    comments = [title_text(report), f"Percent; changes in percentage points{with_intervals}."]
    comments += [report.substrate.note] if report.substrate.note else []
    return table_latex(table, comments, short=True)


def main_numbers(report: Report) -> dict[str, float]:
    """Pairs and outcomes; rates, changes and numbers of sections with their intervals, and rates by event.

    A run that is incomplete has counts, and no rates: it has no score.
    """
    pairs, overall = report.pairs, report.overall
    found: dict[str, float | None] = {
        "pairs/played": pairs.played,
        "pairs/invalid": pairs.invalid,
        "pairs/missing": pairs.missing,
    }
    found |= {f"outcomes/{name}": count for name, count in asdict(overall.outcomes).items()}
    if pairs.complete:
        for name, block in _main(overall).items():
            found |= _with_ends(name, block)
        for _, measure in main_measures(report):
            found |= _with_ends(f"sections/{measure.key}", measure)
        for event, row in report.by["event"].items():
            found |= {f"events/{event}/{name}": block.value for name, block in _main(row).items()}
    return {name: value for name, value in found.items() if value is not None}


def _with_ends(name: str, block: Rate | Change | Measure) -> dict[str, float | None]:
    return {name: block.value, f"{name}_lower": block.lower, f"{name}_upper": block.upper}


def _main(row: Result) -> dict[str, Rate | Change]:
    return {
        "base_success": row.base_success,
        "dynamic_success": row.dynamic_success,
        "paired_change": row.paired_change,
    }
