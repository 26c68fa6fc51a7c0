"""Intervals of times, against their definition and by simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pytest_libero_max.stats.intervals import (
    LEAST_DIFFERENT,
    Interval,
    mean_difference_interval,
    median_interval,
)


def test_the_mean_has_the_t_interval() -> None:
    values = np.random.default_rng(3).normal(5, 20, 40)
    found, known = mean_difference_interval(values), stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert found is not None
    assert (found.lower, found.upper) == pytest.approx((known.low, known.high))


def test_too_few_differences_decide_nothing() -> None:
    few = [1.0] * (LEAST_DIFFERENT - 1) + [0.0] * 50
    assert mean_difference_interval(few) is None
    assert mean_difference_interval([*few, 3.0]) is not None
    assert mean_difference_interval([7.0] * 50) is None
    assert mean_difference_interval([]) is None


@pytest.mark.parametrize("n", [5, 6, 17, 32, 800])
def test_the_median_has_the_narrowest_order_statistics_that_cover(n: int) -> None:
    found, binomial = median_interval(range(1, n + 1)), stats.binom(n, 0.5)
    if found is None:
        assert 2 * binomial.cdf(0) > 0.05
        return
    below = int(found.lower)
    assert found.upper == n + 1 - below
    assert 2 * binomial.cdf(below - 1) <= 0.05 < 2 * binomial.cdf(below)


def test_intervals_of_paired_times_cover() -> None:
    """Episodes of 200 steps at most, 60% and 45% successes: differences pile up at 0 and have long tails."""
    draw = np.random.default_rng(0)
    size = (2000, 32)

    def arm(shape: tuple[int, ...], rate: float) -> np.ndarray:
        return np.where(draw.random(shape) < rate, draw.integers(60, 150, shape), 200)

    large = (1_000_000,)
    mean = float((arm(large, 0.45) - arm(large, 0.6)).mean())
    runs = arm(size, 0.45) - arm(size, 0.6)
    assert _coverage([mean_difference_interval(run) for run in runs], mean) > 0.935
    waits = np.floor(draw.exponential(40, size))
    assert _coverage([median_interval(run) for run in waits], np.floor(40 * np.log(2))) > 0.95


def _coverage(intervals: list[Interval | None], truth: float) -> float:
    decided = [one for one in intervals if one is not None]
    assert len(decided) > 0.99 * len(intervals)
    return float(np.mean([one.lower <= truth <= one.upper for one in decided]))
