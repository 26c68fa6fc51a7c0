"""Two proportions of independent episodes: exact test, interval, sample sizes, and over strata."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE, Interval
from pytest_libero_max.stats.power import ALPHA, MOST_PAIRS, fewest
from pytest_libero_max.stats.ratios import Ratio

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)
_FAR = 1e-13
"""Mass left out at each end of a distribution that is integrated over."""


@dataclass(frozen=True)
class Difference:
    """A difference of two proportions, the first less the second."""

    value: float | None
    interval: Interval | None
    """Its exact interval; None without an episode on one side."""
    log10_p: float | None
    """Decimal logarithm of the two-sided p-value of Fisher's exact test; None likewise."""


def compare_proportions(first: Ratio, second: Ratio, confidence: float = CONFIDENCE) -> Difference:
    """Compare the proportions of two sets of independent episodes.

    The p-value is twice the smaller tail of Fisher's exact test, at most 1. The interval is the melded one:
    Clopper and Pearson's confidence distributions of both proportions are combined. Zero lies outside of it
    exactly where p < 1 - confidence. Both are conservative. Reference: M. P. Fay, M. A. Proschan and
    E. Brittain (2015), Combining one-sample confidence procedures for inference in the two-sample case,
    Biometrics 71:146-156.
    """
    if first.value is None or second.value is None:
        return Difference(None, None, None)
    tail = (1 - confidence) / 2
    interval = Interval(-_upper(second, first, tail), _upper(first, second, tail))
    return Difference(first.value - second.value, interval, _fisher(first, second))


def episodes_to_show(first: float, second: float, alpha: float = ALPHA) -> int | None:
    """Return the number of episodes on each side at which these very rates would be significant.

    The larger count is rounded down and the smaller one up. None above a million, and for equal rates.
    """
    high, low = max(first, second), min(first, second)

    def shown(n: int) -> bool:
        more, less = math.floor(high * n + 1e-9), math.ceil(low * n - 1e-9)
        return more > less and 10 ** _fisher(Ratio(more, n), Ratio(less, n)) < alpha

    return fewest(shown)


def episodes_for_power(first: float, second: float, target: float, alpha: float = ALPHA) -> int | None:
    """Return about how many episodes on each side show a difference of these true rates with a probability.

    The normal approximation with the correction for continuity that follows Fisher's exact test. Reference:
    J. T. Casagrande, M. C. Pike and P. G. Smith (1978), Biometrics 34:483-486. None above a million, and for
    equal rates.
    """
    gap, mean = abs(first - second), (first + second) / 2
    if gap == 0:
        return None
    spread = special.ndtri(1 - alpha / 2) * math.sqrt(2 * mean * (1 - mean))
    spread += special.ndtri(target) * math.sqrt(first * (1 - first) + second * (1 - second))
    plain = (spread / gap) ** 2
    needed = math.ceil(plain / 4 * (1 + math.sqrt(1 + 4 / (plain * gap))) ** 2)
    return needed if needed <= MOST_PAIRS else None


def pairs_to_show(losses: int, gains: int, pairs: int, alpha: float = ALPHA) -> int | None:
    """Return the number of pairs at which these shares of discordant pairs would be significant.

    The larger count is rounded down and the smaller one up. None above a million, and for equal counts.
    """
    from pytest_libero_max.stats.significance import mcnemar

    high, low = max(losses, gains) / pairs, min(losses, gains) / pairs

    def shown(n: int) -> bool:
        return 10 ** mcnemar(math.floor(high * n + 1e-9), math.ceil(low * n - 1e-9)) < alpha

    return fewest(shown)


def _fisher(first: Ratio, second: Ratio) -> float:
    """Decimal logarithm of twice the smaller tail of Fisher's exact test, at most 0."""
    from scipy import stats

    given = stats.hypergeom(first.of + second.of, first.count + second.count, first.of)
    tail = min(float(given.logcdf(first.count)), float(given.logsf(first.count - 1)))
    return min(0.0, (tail + math.log(2)) / math.log(10))


def _upper(first: Ratio, second: Ratio, tail: float) -> float:
    """Upper bound of the first proportion less the second."""
    from scipy.optimize import brentq

    lower, upper = (second.count, second.of - second.count + 1), (first.count + 1, first.of - first.count)

    def exceeds(gap: float) -> float:
        """P(A - B > gap), A by the upper distribution of the first, B by the lower one of the second."""
        if lower[0] == 0:  # B is 0
            return float(upper[1] == 0 or special.betaincc(*upper, max(gap, 0.0)))
        if upper[1] == 0:  # A is 1
            return float(special.betainc(*lower, min(1 - gap, 1.0)))
        low, high = special.betaincinv(*lower, _FAR), special.betainccinv(*lower, _FAR)
        at = low + (high - low) * (1 + _NODES) / 2
        logs = special.xlogy(lower[0] - 1, at) + special.xlog1py(lower[1] - 1, -at) - special.betaln(*lower)
        share = special.betaincc(*upper, np.clip(at + gap, 0, 1))
        return float((high - low) / 2 * (np.exp(logs) * share) @ _WEIGHTS)

    if exceeds(1.0 - 1e-12) >= tail:
        return 1.0
    return float(brentq(lambda gap: exceeds(gap) - tail, -1.0, 1.0 - 1e-12, xtol=1e-11))


_PRECISION = 1e-7
"""Precision of a bound."""
_HALVINGS = 30
_MANY_ERRORS = 1e6
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
    """
    from scipy.optimize import brentq

    counts = np.array([[one.count, one.of, other.count, other.of] for one, other in strata], dtype=np.float64)
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
        return (value - gap) / math.sqrt(total) if total > 0 else math.copysign(_MANY_ERRORS, value - gap)

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
