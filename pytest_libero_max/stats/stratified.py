"""A difference of two proportions over strata: of independent episodes that are alike within a stratum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval
from pytest_libero_max.stats.ratios import Ratio

_PRECISION = 1e-7
"""Precision of a bound."""
_HALVINGS = 30
_FAR = 1e6
"""Standard errors that stand for infinitely many."""
_END = 1 - 1e-9
"""Largest difference that is tried; the variance at 1 is 0."""


FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class StratifiedDifference:
    """A difference of two proportions over strata, the first less the second."""

    value: float
    """Weighted mean of the strata's differences."""
    interval: Interval
    log10_p: float
    """Decimal logarithm of the two-sided p-value."""


def stratified_difference(
    strata: Sequence[tuple[Ratio, Ratio]], confidence: float = CONFIDENCE
) -> StratifiedDifference:
    """Compare two proportions within strata.

    A stratum with m and n episodes has the weight m n / (m + n). The interval holds the differences that the
    score test does not reject. Its variance is that of the most likely proportions with the difference, so it
    has a width where all succeed as well. It is an approximation, with strata of 15 episodes a side good to a
    point of coverage and with single ones to two. Reference: O. S. Miettinen and M. Nurminen (1985),
    Comparative analysis of two rates, Statistics in Medicine 4:213-226.

    Args:
        strata: Successes of the first and of the second in each stratum, with an episode of each.

    Raises:
        ReportError: There is no stratum, or one without an episode of each.
    """
    from scipy.optimize import brentq

    counts = np.array([[one.count, one.of, other.count, other.of] for one, other in strata], dtype=np.float64)
    if not counts.size or (counts[:, [1, 3]] == 0).any():
        raise ReportError("A stratified difference needs strata with an episode on each side.")
    x, m, y, n = counts.T
    weight = m * n / (m + n)
    weight /= weight.sum()
    gaps = x / m - y / n
    value = float(weight @ gaps)

    def score(gap: float) -> float:
        """Deviation of the difference from ``gap``, in standard errors."""
        first, second = _likeliest(x, m, y, n, gap)
        variance = (first * (1 - first) / m + second * (1 - second) / n) * (m + n) / (m + n - 1)
        total = float((weight**2) @ variance)
        if value == gap:
            return 0.0
        return (value - gap) / math.sqrt(total) if total > 0 else math.copysign(_FAR, value - gap)

    critical = float(special.ndtri((1 + confidence) / 2))

    def bound(side: float) -> float:
        """Find the difference beyond the estimate, on one side, that is just rejected."""
        if -side * score(side * _END) <= critical:
            return side
        return float(brentq(lambda gap: score(gap) + side * critical, value, side * _END, xtol=_PRECISION))

    tail = float(special.log_ndtr(-abs(score(0.0))))
    return StratifiedDifference(
        value, Interval(bound(-1.0), bound(1.0)), min(0.0, (tail + math.log(2)) / math.log(10))
    )


def _likeliest(
    x: FloatArray, m: FloatArray, y: FloatArray, n: FloatArray, gap: float
) -> tuple[FloatArray, FloatArray]:
    """Return the most likely proportions of each stratum of which the first is larger by ``gap``.

    The likelihood is concave in the second proportion; the root of its slope is found by halving.
    """
    low, high = np.full_like(x, max(0.0, -gap)), np.full_like(x, min(1.0, 1.0 - gap))
    for _ in range(_HALVINGS):
        second = (low + high) / 2
        first = second + gap
        with np.errstate(divide="ignore", invalid="ignore"):
            up = np.where(x > 0, x / first, 0.0) + np.where(y > 0, y / second, 0.0)
            down = np.where(x < m, (m - x) / (1 - first), 0.0) + np.where(y < n, (n - y) / (1 - second), 0.0)
        rises = up > down
        low, high = np.where(rises, second, low), np.where(rises, high, second)
    second = (low + high) / 2
    return np.clip(second + gap, 0.0, 1.0), second
