"""Intervals for times: the mean of paired differences, and the median."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE, Interval

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
