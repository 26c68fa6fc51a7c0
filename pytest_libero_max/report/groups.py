"""Results by group as tables, the same for every writer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pytest_libero_max.report.document import Table
from pytest_libero_max.report.quantities import TableKind, quantities_in
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.blocks import Result


@dataclass(frozen=True)
class Dimension:
    """One way of grouping pairs."""

    title: str
    label: Callable[[PlannedPair], str]
    """The group of a pair; empty where it is in none."""


DIMENSIONS: Mapping[str, Dimension] = {
    "event": Dimension("Event", lambda pair: pair.event),
    "family": Dimension("Family", lambda pair: pair.family),
    "suite": Dimension("Suite", lambda pair: pair.suite),
    "source": Dimension("Source", lambda pair: pair.source),
    "category": Dimension("Source category", lambda pair: pair.category),
    "severity": Dimension("Severity", lambda pair: pair.severity),
    "variant": Dimension("Event and parameter variant", lambda pair: pair.event_variant),
    "difficulty": Dimension(
        "Difficulty", lambda pair: "none" if pair.difficulty is None else str(pair.difficulty)
    ),
    "program": Dimension("Program", lambda pair: pair.program),
}
"""Dimensions by their key in ``report["by"]`` and in gates, in the order of all writers."""


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
