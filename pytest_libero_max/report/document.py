"""A document: sections of tables, whose numbers stay numbers until a renderer of ``render`` prints them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pytest_libero_max.report.plots import Drawable
from pytest_libero_max.report.quantities import INTERVAL_MARK, TEXT, Cell, Quantity


class Code(str):
    """A name that is shown as it is."""


class Strong(str):
    """A text to be seen first."""


class Link(str):
    """A text that leads to a file beside the document."""

    address: str

    def __new__(cls, text: str, address: str) -> Link:
        link = super().__new__(cls, text)
        link.address = address
        return link


@dataclass(frozen=True)
class Table:
    """One table."""

    title: str
    head: Sequence[str | Quantity[Any]]
    """Headings of the columns, or their quantities; the first one is of the names of the rows."""
    rows: Sequence[Sequence[Any]]
    """As many cells as headings in each; the first one names the row. A cell is a :class:`.Cell`, or a text,
    a whole number or None (nothing is known), which need no format."""
    note: str = ""
    dimension: str = ""
    """Dimension of the groups that the rows are of, so that a page leads to their cases; empty for none."""
    narrow: int = 0
    """Number of its columns that a report shows in the terminal; 0 for no table."""
    key: str = ""
    """Stem of the files that hold it alone; empty for none."""
    sortable: bool = False
    """True if readers of a page may sort its rows."""
    apart: int = 0
    """Index of the first row that stands apart from those above; 0 for none."""

    def headings(self, short: bool = False) -> list[str]:
        """Return the headings of the columns; one of which no cell has an interval announces none."""
        texts = [
            one if isinstance(one, str) else one.short_heading if short else one.title for one in self.head
        ]
        cells = self.cells()
        return [
            text if any(row[place].has_interval for row in cells) else text.removesuffix(INTERVAL_MARK)
            for place, text in enumerate(texts)
        ]

    def explaining_intervals(self, text: str) -> Table:
        """Return the table with a text about its intervals behind its note; without it where it has none."""
        if not any(cell.has_interval for row in self.cells() for cell in row):
            return self
        return replace(self, note=f"{self.note} {text}".strip())

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
    """A part of a document."""

    title: str = ""
    tables: Sequence[Table] = ()
    texts: Sequence[str] = ()
    items: Sequence[str] = ()
    lead: str = ""
    plots: Sequence[Drawable | str] = ()
    """Plots above its tables, or figures as SVG, on pages; other renderers leave them out."""
    folded: bool = False
    """True if a page shows its title alone, which unfolds."""
    key: str = ""
    """Name by which a page knows it; empty for none."""


@dataclass(frozen=True)
class Document:
    """Everything that a terminal, a Markdown file and a page show."""

    title: str
    warnings: Sequence[str] = ()
    """What has to be known before any number."""
    texts: Sequence[str] = ()
    """Other paragraphs above the sections."""
    sections: Sequence[Section] = ()
    caveats: Sequence[str] = ()
    statements: Sequence[str] = ()
