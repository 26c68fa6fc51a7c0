"""Tables as CSV for spreadsheets and LaTeX for papers."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

from pytest_libero_max.report.document import Document, Table
from pytest_libero_max.report.formats import latex_escaped
from pytest_libero_max.stats.measured import number


def table_csv(table: Table) -> str:
    """Return a table as CSV: one column a number; an estimate with its interval has three.

    Rates are fractions; a value that does not exist is empty.
    """
    rows = [[cell.format.numbers(cell.value) for cell in row] for row in table.cells()]
    ends = [
        list(dict.fromkeys(end for row in rows for end in row[place])) for place in range(len(table.head))
    ]
    names = [
        f"{one}{end.replace('_', ' ')}" if isinstance(one, str) else f"{one.key}{end}"
        for one, its_ends in zip(table.head, ends, strict=True)
        for end in its_ends
    ]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow(
            _plain(cell.get(end)) for cell, its_ends in zip(row, ends, strict=True) for end in its_ends
        )
    return buffer.getvalue()


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return number(value)
    return "" if value is None else value


def table_latex(table: Table, comments: Sequence[str], *, short: bool = False) -> str:
    r"""Return a table as a LaTeX ``tabular`` without title and note; ends with a newline."""
    cells = table.cells()
    columns = "".join(
        "l" if all(isinstance(row[place].value, str | None) for row in cells) else "r"
        for place in range(len(table.head))
    )
    lines = [
        *(f"% {latex_escaped(comment)}" for comment in comments),
        rf"\begin{{tabular}}{{{columns}}}",
        r"\hline",
        rf"{' & '.join(map(latex_escaped, table.headings(short)))} \\",
        r"\hline",
    ]
    for index, row in enumerate(cells):
        lines += [r"\hline"] if index == table.apart > 0 else []
        lines.append(rf"{' & '.join(cell.format.latex(cell.value) for cell in row)} \\")
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


def table_files(document: Document) -> dict[str, str]:
    """Return the tables of a document with a key, each as CSV and as LaTeX, by the name of their file."""
    files = {}
    for section in document.sections:
        for table in section.tables:
            if table.key:
                comments = [table.title, *document.texts, *([table.note] if table.note else [])]
                files[f"{table.key}.csv"] = table_csv(table)
                files[f"{table.key}.tex"] = table_latex(table, comments)
    return files
