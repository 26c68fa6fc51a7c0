"""Results by group as tables, the same for every writer."""

from __future__ import annotations

from collections.abc import Mapping

from pytest_libero_max.report.document import Table
from pytest_libero_max.report.quantities import TableKind, quantities_in
from pytest_libero_max.stats.blocks import Result

ALL_PAIRS = "all pairs"

FLOOR_MARK = " *"
"""Mark of a group in which Base success is too low to fall."""

FLOOR_NOTE = "* Base success is below 20%: a small change shows no robustness there."


def group_table(kind: TableKind, title: str, groups: Mapping[str, Result], dimension: str = "event") -> Table:
    """Return one row a group, and a note on groups in which Base success is too low to fall."""
    quantities = quantities_in(kind)
    short = kind == "given_response"  # its title says the rest of the headings
    return Table(
        "",
        (title, *(one.short_heading if short else one for one in quantities)),
        [
            (name + FLOOR_MARK * bool(row.floor), *(one.cell(row) for one in quantities))
            for name, row in groups.items()
        ],
        FLOOR_NOTE if any(row.floor for row in groups.values()) else "",
        dimension,
    )
