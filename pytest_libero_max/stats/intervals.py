"""Intervals: exact for a proportion, the exact bootstrap for a mean of paired differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.stats.ratios import Ratio

CONFIDENCE = 0.95

_TAIL = 1e-16
"""Mass that may be cut from each end of a distribution while it is built up."""

_TIE = 1e-12
"""Rounding allowance where a cumulative probability meets a percentile exactly."""


@dataclass(frozen=True)
class Interval:
    """A two-sided interval on the scale of its estimate."""

    lower: float
    upper: float


@dataclass(frozen=True)
class MeanChange:
    """A mean of paired differences with its bootstrap interval."""

    estimate: float
    lower: float
    upper: float
    pairs: int
    degenerate: bool
    """All differences (of each stratum) are equal, so that resampling cannot vary and the interval has no
    width. It says nothing about precision then."""


def clopper_pearson(ratio: Ratio, confidence: float = CONFIDENCE) -> Interval | None:
    """Exact interval of a binomial proportion; None for n = 0.

    Reference: C. J. Clopper and E. S. Pearson (1934), Biometrika 26:404-413. It covers at least as often as
    it says for every proportion and every n, and is never without a width. Wilson's interval falls to 83%
    near 0 and 1, and the mid-P interval to 92% (``reports/interval-coverage.md``). (SciPy has it in
    ``binomtest``, which spends a hundred times as long on a p-value that is not wanted.)
    """
    count, n = ratio.count, ratio.of
    if n == 0:
        return None
    tail = (1 - confidence) / 2
    return Interval(
        lower=float(special.betaincinv(count, n - count + 1, tail)) if count else 0.0,
        upper=float(special.betainccinv(count + 1, n - count, tail)) if count < n else 1.0,
    )


@dataclass(frozen=True, eq=False)
class Distribution:
    """Probabilities of the consecutive integers from ``start`` on."""

    start: int
    probabilities: NDArray[np.float64]

    def plus(self, other: Distribution) -> Distribution:
        """Return the distribution of the sum of two independent draws (a convolution)."""
        mass = np.convolve(self.probabilities, other.probabilities)
        keep = np.flatnonzero((np.cumsum(mass) > _TAIL) & (np.cumsum(mass[::-1])[::-1] > _TAIL))
        first, last = int(keep[0]), int(keep[-1])
        return Distribution(self.start + other.start + first, mass[first : last + 1])

    def times(self, draws: int) -> Distribution:
        """Return the distribution of the sum of ``draws`` independent draws, by repeated squaring."""
        result, square = Distribution(0, np.ones(1)), self
        while draws:
            if draws & 1:
                result = result.plus(square)
            draws >>= 1
            if draws:
                square = square.plus(square)
        return result

    def quantile(self, q: float) -> int:
        """Inverse CDF: the smallest integer whose cumulative probability reaches ``q``."""
        cumulative = np.cumsum(self.probabilities)
        index = int(np.searchsorted(cumulative, q - _TIE))
        return self.start + min(index, len(cumulative) - 1)


def resampled_total(values: NDArray[np.int64]) -> Distribution:
    """Exact bootstrap distribution of the total of n draws with replacement from n integers, n >= 1."""
    low = int(values.min())
    return Distribution(low, np.bincount(values - low) / len(values)).times(len(values))


def mean_change(
    differences: ArrayLike, strata: ArrayLike | None = None, confidence: float = CONFIDENCE
) -> MeanChange | None:
    """Mean of integer differences with the exact percentile bootstrap interval.

    The distribution of the resampled mean is a convolution of the observed frequencies with themselves, so
    it is computed instead of simulated (to about 1e-14 of probability), and its percentiles are taken by
    the inverse CDF. With strata, every resample keeps the number of pairs of each stratum (fixed
    composition), which is one more convolution. Reference: Efron & Tibshirani (1993), An Introduction to
    the Bootstrap, ch. 13; Hall (1987) on exact bootstrap distributions of lattice means.

    Small n: a percentile interval is too narrow below about 30 pairs and collapses to a point where all
    differences are equal; ``degenerate`` says so. None for no pairs.

    Args:
        differences: (n,) integers; for paired binary outcomes Dynamic - Base.
        strata: (n,) labels, or None.
    """
    values = np.asarray(differences, dtype=np.int64)
    if values.size == 0:
        return None
    labels = np.zeros(len(values), dtype=np.int64) if strata is None else np.asarray(strata)
    total, degenerate = Distribution(0, np.ones(1)), True
    for label in np.unique(labels):
        members = values[labels == label]
        total = total.plus(resampled_total(members))
        degenerate &= bool((members == members[0]).all())
    tail = (1 - confidence) / 2
    n = len(values)
    return MeanChange(
        estimate=int(values.sum()) / n,
        lower=total.quantile(tail) / n,
        upper=total.quantile(1 - tail) / n,
        pairs=n,
        degenerate=degenerate,
    )


LEAST_DIFFERENT = 10
"""Fewer pairs that differ than this give a mean difference no interval."""


def mean_difference_interval(differences: ArrayLike, confidence: float = CONFIDENCE) -> Interval | None:
    """Student's t interval of the mean of paired differences.

    The t interval is about the mean of many like pairs, and too narrow where a few large differences decide:
    None with fewer than :data:`LEAST_DIFFERENT` differences other than 0, and where all are equal.
    """
    values = np.sort(np.asarray(differences, dtype=np.float64))  # the order of the pairs changes no bit
    if np.count_nonzero(values) < LEAST_DIFFERENT or (values == values[0]).all():
        return None
    mean = float(values.mean())
    error = float(values.std(ddof=1)) / len(values) ** 0.5
    away = error * float(special.stdtrit(len(values) - 1, (1 + confidence) / 2))
    return Interval(mean - away, mean + away)


def median_interval(values: ArrayLike, confidence: float = CONFIDENCE) -> Interval | None:
    """Interval of a median between two order statistics; None with fewer than 6 values at 95%.

    It covers at least as often as it says for every distribution, also where values are equal. Reference:
    H. A. David and H. N. Nagaraja (2003), Order Statistics, 7.1.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    n = len(ordered)
    below = sum(float(special.bdtr(k, n, 0.5)) <= (1 - confidence) / 2 for k in range(n // 2))
    return Interval(float(ordered[below - 1]), float(ordered[n - below])) if below else None
