"""Verdicts on gates as rows of a report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pytest_libero_max.report.gates import Finding, GateResult, shown

_NAMED = 3


class GateRow(NamedTuple):
    """A verdict as reports show it."""

    gate: str
    finding: Finding
    """One of :data:`~pytest_libero_max.report.gates.Finding`."""
    value: str
    """Value of its quantity, in the unit of the gate."""
    why: str
    """What else explains the verdict; empty where the value does."""
    lost: Sequence[str]
    """Item ids of the pairs that count against it."""


def gate_rows(results: Iterable[GateResult]) -> list[GateRow]:
    """Return a row for each gate, for the page and the Markdown of a report."""
    rows = []
    for result in results:
        value, why = "n/a", result.detail
        if result.value is not None:  # which the detail begins with, and with the verdict after it
            value, why = shown(result.gate, result.value), why.partition(". ")[2].partition(": ")[2]
        why = f"{why[:1].upper()}{why[1:]} {result.differences}".strip()
        rows.append(GateRow(result.gate.text, result.finding, value, why, result.lost))
    return rows


def named_pairs(names: Sequence[str]) -> str:
    """Return the first pairs by name, and the number of the others."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{', '.join(names[:_NAMED])}{more}"
