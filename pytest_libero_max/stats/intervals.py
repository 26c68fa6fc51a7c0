"""Intervals: exact for a proportion, the exact bootstrap for a mean of paired differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.errors import ReportError, counted
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


def resampled_total(values: ArrayLike) -> Distribution:
    """Exact bootstrap distribution of the total of n draws with replacement from n integers.

    Args:
        values: (n,) integers, n >= 1; for paired differences -1, 0 and 1.
    """
    numbers = np.asarray(values)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu" or numbers.size == 0:
        raise ReportError(
            f"values have shape {numbers.shape} and type {numbers.dtype}, but must be a list of integers, "
            "at least one."
        )
    low = int(numbers.min())
    frequencies = np.bincount(numbers.astype(np.int64) - low) / len(numbers)
    return Distribution(low, frequencies).times(len(numbers))


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
    values = np.asarray(differences)
    if values.size == 0:
        return None
    labels = np.zeros(len(values), dtype=np.int64) if strata is None else np.asarray(strata)
    if labels.shape != values.shape:
        raise ReportError(
            f"{len(labels)} strata for {counted(len(values), 'difference')}; give one label a pair."
        )
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
