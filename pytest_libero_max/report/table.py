"""A table of texts, which every writer prints in its own way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """One table.

    Attributes:
        title: Heading.
        head: Headings of the columns.
        rows: As many cells as headings in each; the first one names the row.
        note: Help for reading it; empty for none.
        narrow: Number of its columns that the terminal prints; 0 for no table.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    narrow: int = 0


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
