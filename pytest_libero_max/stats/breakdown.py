"""Breakdowns: the same measurement per group, macro averages, and the largest split within an event."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.outcome_table import Outcomes
from pytest_libero_max.stats.paired import PairedResult, Pairs, measure_groups

FLOOR_BASE_RATE = 0.2
"""Below this Base success rate a small change does not show a successful response (the paper's limit)."""


@dataclass(frozen=True)
class MacroAverage:
    """Unweighted mean over groups of unequal size; secondary to the rates over all pairs."""

    groups: int
    base: float | None
    """Mean of the groups' Base success rates; None where a group has no pair, like all below."""
    dynamic: float | None
    """Mean of their Dynamic success rates."""
    change: float | None
    """Mean of their paired changes."""


@dataclass(frozen=True)
class Split:
    """Two parameter variants of one event. They hold different source instances: a description, no effect."""

    event: str
    rates: Mapping[str, float]
    """Dynamic success rate of each variant."""
    difference: float
    """Largest minus smallest."""


def breakdown(pairs: Pairs, labels: ArrayLike, groups: Sequence[str]) -> dict[str, PairedResult]:
    """Measure each group.

    Args:
        pairs: All pairs.
        labels: (n,) the group of each pair.
        groups: Every group, in the order wanted; one without pairs yields a result of zero pairs.

    Raises:
        ReportError: A pair's label is not among the groups, so that it would be lost from every denominator.
    """
    names = np.asarray(labels, dtype=np.str_)
    if len(names) != len(pairs):
        raise ReportError(f"{len(names)} labels for {len(pairs)} pairs; give one label a pair.")
    strays = sorted(set(names.tolist()) - set(groups))
    if strays:
        raise ReportError(f"Pairs are labelled {strays}, which are not among the groups {list(groups)}.")
    results = measure_groups([pairs.where(names == group) for group in groups])
    return dict(zip(groups, results, strict=True))


def macro_average(groups: Sequence[Outcomes]) -> MacroAverage:
    """Average rates over groups, each with the same weight. None if a group is empty or there is none."""
    if not groups or any(group.total == 0 for group in groups):
        return MacroAverage(len(groups), None, None, None)

    def mean(rates: list[float | None]) -> float:
        return float(np.mean(np.asarray(rates, dtype=np.float64)))

    return MacroAverage(
        groups=len(groups),
        base=mean([group.base.value for group in groups]),
        dynamic=mean([group.dynamic.value for group in groups]),
        change=mean([group.change.value for group in groups]),
    )


def largest_split(events: Mapping[str, Mapping[str, Outcomes]]) -> Split | None:
    """Return the event whose variants differ most in Dynamic success; the first one among equals.

    Args:
        events: Outcomes by event and variant. Variants without pairs are left out, and so are events with
            fewer than two variants left. None where no event remains.
    """
    best: Split | None = None
    for event, variants in events.items():
        rates = {name: rate for name, cell in variants.items() if (rate := cell.dynamic.value) is not None}
        if len(rates) < 2:
            continue
        difference = max(rates.values()) - min(rates.values())
        if best is None or difference > best.difference:
            best = Split(event, rates, difference)
    return best


def at_floor(outcomes: Outcomes) -> bool | None:
    """Return True if Base success leaves too little room to fall; None without pairs."""
    rate = outcomes.base.value
    return None if rate is None else rate < FLOOR_BASE_RATE
