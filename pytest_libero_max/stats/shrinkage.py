"""Empirical-Bayes estimates of many groups with few pairs: each is drawn towards the mean of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE

FloatArray = NDArray[np.float64]

LEAST_GROUPS = 5
"""Number of groups from which on their spread is estimated."""


_HALVINGS = 50
"""Number of bisections of a half width."""

_BORROWED = 4
"""Number of pairs with the outcomes of all groups together that a group's variance takes in."""


@dataclass(frozen=True)
class Shrunken:
    """A group's estimate, drawn towards the mean of all groups.

    Attributes:
        pairs: Pairs of the group.
        raw: Mean of the group alone.
        value: The estimate.
        weight: Weight of the group's own mean in it, 0 to 1; the rest is the mean of all pairs.
        lower: Lower end of the interval.
        upper: Upper end of the interval.
    """

    pairs: int
    raw: float
    value: float
    weight: float
    lower: float
    upper: float


def shrunken(
    changes: ArrayLike, labels: ArrayLike, confidence: float = CONFIDENCE, bound: float = 1.0
) -> dict[str, Shrunken] | None:
    """Estimate the mean of every group together with all others.

    The means are taken as normal around their group's true value, and the true values as spread around the
    mean of all pairs with a variance that is estimated by moments. The variance within a group is that of its
    pairs and of a few with the outcomes of all.

    The intervals are the robust ones of Armstrong, Kolesar and Plagborg-Moller (2022), Econometrica
    90:2567-2602, with the second moment alone: for many groups they hold the level on average over the
    groups, whatever the shape of the spread, and not for each single one.

    Args:
        changes: (n,) values of pairs from -bound to bound, for example Dynamic less Base.
        labels: (n,) the group of each pair.
        confidence: Level of the intervals.
        bound: Largest value of a pair; estimates and ends stay within.

    Returns:
        By group, in the order of their names; None with fewer than :data:`LEAST_GROUPS` groups, or where all
        values are equal.
    """
    values = np.asarray(changes, dtype=np.float64)
    names, group = np.unique(np.asarray(labels, dtype=np.str_), return_inverse=True)
    pairs = np.bincount(group)
    if len(names) < LEAST_GROUPS or np.ptp(values) == 0:
        return None
    raw = np.bincount(group, weights=values) / pairs
    squares = np.bincount(group, weights=values**2) + _BORROWED * (values**2).mean()
    sums = np.bincount(group, weights=values) + _BORROWED * values.mean()
    error = (squares / (pairs + _BORROWED) - (sums / (pairs + _BORROWED)) ** 2) / pairs
    mean = float(values.mean())
    spread = max(
        float((pairs * ((raw - mean) ** 2 - error)).sum() / pairs.sum()),
        float(2 * (pairs**2 * error**2).sum() / (pairs.sum() * (pairs * error).sum())),
    )
    weight = spread / (spread + error)
    centre = weight * raw + (1 - weight) * mean
    half = critical_values(error / spread, 1 - confidence) * weight * np.sqrt(error)
    return {
        str(name): Shrunken(
            pairs=int(pairs[index]),
            raw=float(raw[index]),
            value=float(centre[index]),
            weight=float(weight[index]),
            lower=round(max(float(centre[index] - half[index]), -bound), 9),
            upper=round(min(float(centre[index] + half[index]), bound), 9),
        )
        for index, name in enumerate(names)
    }


def critical_values(bias: FloatArray, level: float) -> FloatArray:
    """Return the half widths, in standard errors, at which biased normal estimates err with a probability.

    Args:
        bias: (m,) mean of the squared bias over the groups, in squared standard errors.
        level: Largest probability that an interval misses, over all distributions of that bias.
    """
    low, high = np.zeros_like(bias), np.sqrt((1 + bias) / level) + 1
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        wide = _missed(bias, middle) <= level
        low, high = np.where(wide, low, middle), np.where(wide, middle, high)
    return high


def _missed(bias: FloatArray, width: FloatArray) -> FloatArray:
    """Return the largest probability of a miss, over the spreads of the bias on zero and one other value."""
    root = np.sqrt(bias)
    other = root[:, None] + (width[:, None] + 8) * np.linspace(0, 1, 301)[1:]
    missed = special.ndtr(other - width[:, None]) + special.ndtr(-width[:, None] - other)
    never = 2 * special.ndtr(-width[:, None])
    worst: FloatArray = (never + bias[:, None] / other**2 * (missed - never)).max(axis=1)
    return worst
