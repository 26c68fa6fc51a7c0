"""Breakdowns: the same measurement per group, macro averages, and the largest split within an event."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.blocks import Macro, Outcomes, Result, Split
from pytest_libero_max.stats.measured import number
from pytest_libero_max.stats.paired import Pairs, measure_groups


def breakdown(
    pairs: Pairs, labels: ArrayLike, groups: Sequence[str], planned: Mapping[str, int] | None = None
) -> dict[str, Result]:
    """Measure each group.

    Args:
        groups: Every group, in the order wanted; one without pairs yields a result of zero pairs.
        planned: Number of planned pairs of each group; by default those that are measured.

    Raises:
        ReportError: A pair's label is not among the groups, so that it would be lost from every denominator.
    """
    names = np.asarray(labels, dtype=np.str_)
    strays = sorted(set(names.tolist()) - set(groups))
    if strays:
        raise ReportError(f"Pairs are labelled {strays}, which are not among the groups {list(groups)}.")
    counts = None if planned is None else [planned[group] for group in groups]
    results = measure_groups([pairs.where(names == group) for group in groups], counts)
    return dict(zip(groups, results, strict=True))


def macro_average(groups: Sequence[Outcomes]) -> Macro:
    """Average rates over groups, each with the same weight. None if a group is empty or there is none."""
    if not groups or any(group.total == 0 for group in groups):
        return Macro(groups=len(groups), base_success=None, dynamic_success=None, paired_change=None)

    def mean(rates: list[float | None]) -> float | None:
        return number(float(np.mean(np.asarray(rates, dtype=np.float64))))

    return Macro(
        groups=len(groups),
        base_success=mean([group.base.value for group in groups]),
        dynamic_success=mean([group.dynamic.value for group in groups]),
        paired_change=mean([group.change.value for group in groups]),
    )


def largest_split(events: Mapping[str, Mapping[str, Outcomes]]) -> Split | None:
    """Return the event whose variants differ most in Dynamic success; the first one among equals.

    Args:
        events: Outcomes by event and variant. Variants without pairs are left out, and so are events with
            fewer than two variants left. None where no event remains.
    """
    best: tuple[float, str, dict[str, float]] | None = None
    for event, variants in events.items():
        rates = {name: rate for name, cell in variants.items() if (rate := cell.dynamic.value) is not None}
        if len(rates) < 2:
            continue
        difference = max(rates.values()) - min(rates.values())
        if best is None or difference > best[0]:
            best = difference, event, rates
    if best is None:
        return None
    difference, event, rates = best
    dynamic = {name: number(rate) for name, rate in rates.items()}
    return Split(event=event, dynamic_success=dynamic, difference=number(difference))
