"""The ways in which pairs are grouped in a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pytest_libero_max.runs.plan import PlannedPair


@dataclass(frozen=True)
class Dimension:
    """One way of grouping pairs."""

    title: str
    """Heading of its table."""
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
