"""Documents as lines of the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from pytest_libero_max.report.document import Document, Section, Table

WIDTH = 100
"""Characters of a line of words."""


def aligned(rows: Sequence[Sequence[str]], *, numbers: bool = False) -> list[str]:
    """Return rows as lines with columns as wide as their longest cell, two spaces apart.

    Args:
        rows: The headings first, as many cells in each.
        numbers: True if all columns but the first are aligned on the right.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if numbers and place else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def table_lines(table: Table, *, short: bool = True, numbers: bool = True) -> list[str]:
    """Return a table without its title and its note; see :func:`aligned`."""
    return aligned([table.headings(short), *table.texts(short)], numbers=numbers)


def section_lines(section: Section, *, short: bool = True) -> list[str]:
    """Return a section: its title, its tables, each with title and note, and its words."""
    lines = [*([section.title] if section.title else []), *wrap(section.lead, WIDTH)]
    for number, table in enumerate(section.tables):
        lines += [""] * bool(number) + [table.title] * bool(table.title)
        lines += [*table_lines(table, short=short), *wrap(table.note, WIDTH)]
    lines += [line for text in section.texts for line in wrap(text, WIDTH)]
    return [*lines, *section.items]


def sections_lines(sections: Sequence[Section], *, short: bool = True) -> list[str]:
    """Return sections, an empty line above each."""
    return [line for section in sections for line in ("", *section_lines(section, short=short))]


def document_lines(document: Document) -> list[str]:
    """Return a document without its caveats and statements, its numbers with their counts."""
    return [
        document.title,
        *(line for text in document.texts for line in wrap(text, WIDTH)),
        *(f"WARNING: {text}" for text in document.warnings),
        *sections_lines(document.sections, short=False),
    ]
