"""Extremes by chance: the lowest group and the largest split where nothing but chance tells groups apart.

The outcomes of all pairs are dealt to the groups at random, as in a permutation test. The draws have a fixed
seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
