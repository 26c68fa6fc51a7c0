"""The report's breakdowns as tables: CSV for spreadsheets and LaTeX for papers."""

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
from pytest_libero_max.stats.blocks import Measure, Result

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
