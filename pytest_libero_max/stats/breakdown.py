"""Breakdowns: the same measurement per group, macro averages, and the largest split within an event."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    """
    names = np.asarray(labels, dtype=np.str_)
    counts = None if planned is None else [planned[group] for group in groups]
    results = measure_groups([pairs.at(names == group) for group in groups], counts)
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


DRAWS = 2000

LEVEL = 0.05
"""Share of the draws that may be as extreme as what is seen for it to be more than chance."""


@dataclass(frozen=True)
class ByChance:
    """An extreme by chance."""

    expected: float
    share: float
    """Share of the draws that are at least as extreme as what is seen."""

    @property
    def explains(self) -> bool:
        return self.share > LEVEL


def lowest_by_chance(sizes: Sequence[int], gains: int, losses: int, seen: float) -> ByChance:
    """Return the lowest mean of a group by chance.

    Args:
        gains: Pairs, of all, that count 1.
        losses: Pairs, of all, that count -1.
    """
    random, n = np.random.default_rng(0), np.asarray(sizes)
    up = _dealt(random, n, gains)
    means = up / n
    if losses:
        left = n - up
        rows = [random.multivariate_hypergeometric(row, losses) for row in left]
        means = (up - np.stack(rows)) / n
    lowest = means.min(axis=1)
    return ByChance(float(lowest.mean()), float((lowest <= seen + 1e-12).mean()))


def split_by_chance(events: Sequence[tuple[Sequence[int], int]], seen: float) -> ByChance:
    """Return the largest split between the variants of an event by chance.

    Args:
        events: Number of pairs of each variant and successes of all, by event.
    """
    random = np.random.default_rng(0)
    splits = [
        np.ptp(_dealt(random, np.asarray(sizes), count) / np.asarray(sizes), axis=1)
        for sizes, count in events
    ]
    largest = np.max(splits, axis=0)
    return ByChance(float(largest.mean()), float((largest >= seen - 1e-12).mean()))


def _dealt(random: np.random.Generator, sizes: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return random.multivariate_hypergeometric(sizes, count, size=DRAWS)
