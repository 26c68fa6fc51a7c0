"""A document: sections of tables, whose numbers stay numbers until a renderer of ``render`` prints them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from pytest_libero_max.report.quantities import TEXT, Cell, Quantity


@dataclass(frozen=True)
class Table:
    """One table.

    Attributes:
        title: Heading.
        head: Headings of the columns, or their quantities; the first one is of the names of the rows.
        rows: As many cells as headings in each; the first one names the row. A cell is a :class:`.Cell`, or a
            text, a whole number or None (nothing is known), which need no format.
        note: Help for reading it; empty for none.
        dimension: Dimension of the groups that the rows are of, so that a page leads to their cases; empty
            for none.
        narrow: Number of its columns that a report shows in the terminal; 0 for no table.
    """

    title: str
    head: Sequence[str | Quantity[Any]]
    rows: Sequence[Sequence[Any]]
    note: str = ""
    dimension: str = ""
    narrow: int = 0

    def headings(self, short: bool = False) -> list[str]:
        """Return the headings of the columns."""
        return [
            one if isinstance(one, str) else one.short_heading if short else one.title for one in self.head
        ]

    def cells(self) -> list[list[Cell]]:
        """Return the rows with a format for each cell."""
        return [[one if isinstance(one, Cell) else Cell(one, TEXT) for one in row] for row in self.rows]

    def texts(self, short: bool = False) -> list[list[str]]:
        """Return the rows as texts, for a narrow table if ``short``."""
        return [
            [cell.format.short(cell.value) if short else cell.format.long(cell.value) for cell in row]
            for row in self.cells()
        ]


def table_of(
    title: str, name: str, quantities: Sequence[Quantity[Any]], rows: Iterable[tuple[str, Any]], **more: Any
) -> Table:
    """Return a table of some quantities, one row for each name and what they are read from."""
    return Table(
        title,
        (name, *quantities),
        [(label, *(quantity.cell(row) for quantity in quantities)) for label, row in rows],
        **more,
    )


@dataclass(frozen=True)
class Section:
    """A part of a document.

    Attributes:
        title: Heading; empty for none.
        tables: Its tables.
        texts: Paragraphs below them.
        items: A list below these.
    """

    title: str = ""
    tables: Sequence[Table] = ()
    texts: Sequence[str] = ()
    items: Sequence[str] = ()


@dataclass(frozen=True)
class Document:
    """Everything that a terminal, a Markdown file and a page show.

    Attributes:
        title: Heading.
        warnings: What has to be known before any number.
        texts: Other paragraphs above the sections.
        sections: In the order in which they are read.
        caveats: Notes on single pairs.
        statements: Limits of the numbers.
    """

    title: str
    warnings: Sequence[str] = ()
    texts: Sequence[str] = ()
    sections: Sequence[Section] = ()
    caveats: Sequence[str] = ()
    statements: Sequence[str] = ()
