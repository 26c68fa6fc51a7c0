"""The report's breakdowns as CSV for spreadsheets and LaTeX for papers."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

from msgspec.structs import asdict

from pytest_libero_max.benchmark.documents import Json, printable
from pytest_libero_max.report.blocks import Result
from pytest_libero_max.report.columns import COLUMNS, columns_in, headings
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.report_document import Macro, Report
from pytest_libero_max.report.writers.summary import title_text

ALL_PAIRS = "overall"

_LATEX = {letter: f"\\{letter}" for letter in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
"""Letters that mean something to LaTeX, as it prints them."""


def csv_text(report: Report) -> str:
    """Return a row for the run and every group, one column or three (estimate and interval) a quantity.

    After the groups come the unweighted mean over source categories (``macro``), for every source the
    category of lowest Base success and of largest loss, and the two variants of the largest split.

    Rates are fractions; a value that does not exist is empty.
    """
    buffer = io.StringIO()
    rows = [dict(cells) for cells in _csv_rows(report)]
    writer = csv.DictWriter(buffer, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def _csv_rows(report: Report) -> Iterator[Json]:
    yield _csv_row(ALL_PAIRS, ALL_PAIRS, report.overall)
    for dimension in DIMENSIONS:
        for group, row in report.by[dimension].items():
            yield _csv_row(dimension, group, row)
    yield _macro_row(report.macro.category)
    for source, extremes in report.extremes.items():
        for what, group in asdict(extremes).items():
            yield _csv_row(f"{what}.{source}", group, report.by["category"][group])
    if report.largest_split is not None:
        event = report.largest_split.event
        for variant in report.largest_split.dynamic_success:
            group = f"{event}-{variant}"
            yield _csv_row("largest_split", group, report.by["variant"][group])


def _macro_row(macro: Macro) -> Json:
    rates = asdict(macro)
    del rates["groups"]
    return {"dimension": "macro", "group": "category", **rates}


def _csv_row(dimension: str, group: str, row: Result) -> Json:
    values: Json = {"dimension": dimension, "group": group}
    for column in COLUMNS:
        values |= column.numbers(row)
    return values


def latex_text(report: Report) -> str:
    """Return a ``tabular`` of the events in percent and percentage points, the whole run as its last row."""
    columns = columns_in("narrow")
    rows = [*report.by["event"].items(), ("All pairs", report.overall)]
    head = (DIMENSIONS["event"].title, *headings("narrow"))
    comments = [title_text(report), "Percent; changes in percentage points with their 95% interval."]
    comments += [report.substrate.note] if report.substrate.note else []
    cells = [(latex_escaped(group), *(column.latex(row) for column in columns)) for group, row in rows]
    return tabular(comments, f"l{'r' * len(columns)}", head, cells, len(rows) - 1)


def tabular(
    comments: Sequence[str], columns: str, head: Sequence[str], rows: Sequence[Sequence[str]], ruled: int
) -> str:
    """Return a LaTeX ``tabular``; ends with a newline.

    Args:
        comments: Lines above it.
        columns: Alignment of the columns, a letter each.
        head: Headings.
        rows: Cells as LaTeX.
        ruled: Index of the row that has a line above it; 0 for none.
    """
    lines = [
        *(f"% {latex_escaped(comment)}" for comment in comments),
        rf"\begin{{tabular}}{{{columns}}}",
        r"\hline",
        rf"{' & '.join(map(latex_escaped, head))} \\",
        r"\hline",
    ]
    for index, row in enumerate(rows):
        lines += [r"\hline"] if index == ruled > 0 else []
        lines.append(rf"{' & '.join(row)} \\")
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


def latex_escaped(text: str) -> str:
    """Return a text as LaTeX prints it."""
    return "".join(_LATEX.get(letter, letter) for letter in printable(text))
