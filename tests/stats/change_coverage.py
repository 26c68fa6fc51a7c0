"""How often the interval of a difference of two paired changes holds the truth.

A true effect is the probabilities of the differences -2, -1, 1 and 2 of a case; the cases are independent. Up
to :data:`ENUMERATED` cases the coverage is summed over all results.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pytest_libero_max.stats.bounded_mean import bounds, exceed

Weights = tuple[float, float, float, float]
"""Probabilities of -2, -1, 1 and 2."""

VALUES = np.arange(-2.0, 3.0)
ENUMERATED = 16
DRAWS = 20_000
"""Results drawn for more cases; standard error at most 0.18 points above 93%."""

_TIE = 1e-9
"""A bound this close to the truth holds it; rounding decides nothing."""


def change_coverage(cases: int, weights: Weights, confidence: float = 0.95) -> float:
    """Coverage for a number of cases and a true effect."""
    shares = _shares(weights)
    truth = float(VALUES @ shares)
    if cases <= ENUMERATED:
        counts = _results(cases)
        return float(_mass(counts, shares)[holds(counts, truth, confidence)].sum())
    drawn = np.random.Generator(np.random.PCG64(cases)).multinomial(cases, shares, size=DRAWS)
    counts, times = np.unique(drawn, axis=0, return_counts=True)
    return float(times[holds(counts, truth, confidence)].sum() / DRAWS)


def joint_coverage(cases: int, weights: Weights, groups: int = 8) -> float:
    """Probability that the intervals of independent groups, as a family has them, all hold the truth."""
    return change_coverage(cases, weights, 1 - 0.05 / groups) ** groups


def holds(counts: NDArray[np.int64], truth: float, confidence: float = 0.95) -> NDArray[np.bool_]:
    """Whether the interval of each row of counts holds a mean, without computing its ends."""
    tail = (1 - confidence) / 2
    return ~(_is_below(counts, truth, tail) | _is_below(counts[:, ::-1], -truth, tail))


def _is_below(counts: NDArray[np.int64], truth: float, tail: float) -> NDArray[np.bool_]:
    """Whether the upper bound of each row is below the truth."""
    shapes = counts.astype(np.float64)
    shapes[:, -1] += 1
    beyond = np.flatnonzero((shapes @ VALUES < shapes.sum(axis=1) * truth) & (truth < VALUES[-1]))
    below = np.zeros(len(counts), dtype=np.bool_)
    for rows in np.array_split(beyond, 1 + len(beyond) // 1024):
        limits = np.full(len(rows), truth - _TIE)
        below[rows] = exceed(shapes[rows], VALUES, limits) < tail if len(rows) else False
    return below


def lowest_change_coverage(cases: int, effects: int = 1500) -> tuple[float, Weights]:
    """The lowest coverage over drawn true effects and over all mixtures of two values on a lattice."""
    random = np.random.Generator(np.random.PCG64(1))
    candidates = [random.dirichlet(10 ** random.uniform(-2, 1, 5)) for _ in range(effects)]
    for share in (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, *np.linspace(0.1, 0.5, 17)):
        for places in permutations(range(5), 2):
            mixture = np.zeros(5)
            mixture[[*places]] = share, 1 - share
            candidates.append(mixture)
    counts = _results(cases)
    lower, upper = bounds(counts)
    lowest, where = 1.0, np.zeros(5)
    for shares in candidates:
        held = (lower <= VALUES @ shares + _TIE) & (VALUES @ shares - _TIE <= upper)
        covered = float(_mass(counts, shares)[held].sum())
        if covered < lowest - 1e-12:
            lowest, where = covered, shares
    losses, loss, _, gain, gains = where.tolist()
    return lowest, (losses, loss, gain, gains)


def _shares(weights: Weights) -> NDArray[np.float64]:
    first, second, third, fourth = weights
    return np.array([first, second, 1 - sum(weights), third, fourth])


@cache
def _results(cases: int) -> NDArray[np.int64]:
    """All counts of the five values, (rows, 5)."""
    grid = np.indices((cases + 1,) * 4).reshape(4, -1).T
    some = grid[grid.sum(axis=1) <= cases]
    return np.column_stack([some, cases - some.sum(axis=1)])


def _mass(counts: NDArray[np.int64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    cases = counts.sum(axis=1)
    ways = special.gammaln(cases + 1) - special.gammaln(counts + 1).sum(axis=1)
    mass: NDArray[np.float64] = np.exp(ways + special.xlogy(counts, shares).sum(axis=1))
    return mass
