from __future__ import annotations

from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pytest_libero_max.stats.intervals import (
    LEAST_DIFFERENT,
    Interval,
    clopper_pearson,
    mean_change,
    mean_difference_interval,
    median_interval,
    resampled_total,
)
from pytest_libero_max.stats.ratios import Ratio

DIFFERENCES = st.lists(st.integers(-1, 1), min_size=1, max_size=40)


@pytest.mark.parametrize(
    ("count", "of", "lower", "upper"),
    [
        # R. G. Newcombe (1998), Statistics in Medicine 17:857-872, table I, method 5.
        (81, 263, 0.2527, 0.3676),
        (15, 148, 0.0578, 0.1617),
        (0, 20, 0.0000, 0.1684),
        (1, 29, 0.0009, 0.1776),
    ],
)
def test_a_rate_has_the_published_interval(count: int, of: int, lower: float, upper: float) -> None:
    interval = clopper_pearson(Ratio(count, of))
    assert interval is not None
    assert interval.lower == pytest.approx(lower, abs=5e-5)
    assert interval.upper == pytest.approx(upper, abs=5e-5)


@given(st.integers(1, 9000).flatmap(lambda of: st.tuples(st.integers(0, of), st.just(of))))
def test_the_interval_of_a_rate_is_what_scipy_gives(counts: tuple[int, int]) -> None:
    interval = clopper_pearson(Ratio(*counts))
    expected = stats.binomtest(*counts).proportion_ci(0.95, method="exact")
    assert interval is not None
    assert (interval.lower, interval.upper) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_a_rate_of_nothing_has_no_interval() -> None:
    assert clopper_pearson(Ratio(0, 0)) is None


@given(st.integers(1, 2000).flatmap(lambda of: st.tuples(st.integers(0, of), st.just(of))))
def test_a_rate_lies_within_its_interval(counts: tuple[int, int]) -> None:
    count, of = counts
    interval = clopper_pearson(Ratio(count, of))
    assert interval is not None
    assert 0 <= interval.lower <= count / of + 1e-12
    assert count / of - 1e-12 <= interval.upper <= 1
    assert interval.lower < interval.upper


@settings(deadline=None)
@given(st.lists(st.integers(-2, 2), min_size=1, max_size=5))
def test_the_exact_bootstrap_is_what_enumeration_finds(values: list[int]) -> None:
    n = len(values)
    totals = Counter(sum(sample) for sample in product(values, repeat=n))
    exact = resampled_total(np.array(values))
    for index, probability in enumerate(exact.probabilities):
        assert probability == pytest.approx(totals[exact.start + index] / n**n, abs=1e-12)
    assert exact.probabilities.sum() == pytest.approx(1, abs=1e-12)
    ordered = sorted(totals.elements())
    for q in (0.025, 0.5, 0.975):
        assert exact.quantile(q) == ordered[int(np.ceil(q * n**n - 1e-9)) - 1]


def test_the_stratified_bootstrap_is_what_enumeration_finds() -> None:
    first, second = [1, 0, -1], [-1, -1, 0, 0]
    totals = sorted(sum(a) + sum(b) for a in product(first, repeat=3) for b in product(second, repeat=4))
    result = mean_change(first + second, ["a"] * 3 + ["b"] * 4)
    assert result is not None
    assert result.lower == totals[int(np.ceil(0.025 * len(totals))) - 1] / 7
    assert result.upper == totals[int(np.ceil(0.975 * len(totals))) - 1] / 7


@pytest.mark.parametrize("n", [60, 400])
def test_simulation_approaches_the_exact_bootstrap(n: int) -> None:
    random = np.random.default_rng(20260830)
    values = random.choice([-1, 0, 1], size=n, p=[0.25, 0.65, 0.1])
    exact = mean_change(values)
    means = random.choice(values, size=(20_000, n)).mean(axis=1)
    simulated = np.quantile(means, [0.025, 0.975], method="inverted_cdf")
    assert exact is not None
    assert exact.lower == pytest.approx(simulated[0], abs=1.01 / n)
    assert exact.upper == pytest.approx(simulated[1], abs=1.01 / n)


@given(st.data(), DIFFERENCES)
def test_the_order_of_pairs_never_shows(data: st.DataObject, values: list[int]) -> None:
    assert mean_change(values) == mean_change(data.draw(st.permutations(values)))


@given(DIFFERENCES)
def test_exchanging_the_conditions_mirrors_the_distribution(values: list[int]) -> None:
    forward, backward = resampled_total(np.array(values)), resampled_total(-np.array(values))
    np.testing.assert_allclose(forward.probabilities, backward.probabilities[::-1], rtol=0, atol=1e-12)


@given(DIFFERENCES)
def test_one_stratum_is_no_stratification(values: list[int]) -> None:
    assert mean_change(values) == mean_change(values, ["plus"] * len(values))


@given(DIFFERENCES)
def test_the_interval_holds_the_estimate_and_flags_its_collapse(values: list[int]) -> None:
    result = mean_change(values)
    assert result is not None
    assert result.lower <= result.estimate <= result.upper
    assert result.degenerate == (len(set(values)) == 1)
    if result.degenerate:
        assert result.lower == result.upper == values[0]


def test_no_pairs_have_no_change() -> None:
    assert mean_change([]) is None


def test_eight_thousand_pairs_lose_no_probability() -> None:
    values = np.repeat([-1, 0, 1], [2171, 5652, 177])
    exact = resampled_total(values)
    assert exact.probabilities.sum() == pytest.approx(1, abs=1e-12)
    mean = (exact.probabilities * (exact.start + np.arange(len(exact.probabilities)))).sum() / 8000
    assert mean == pytest.approx((177 - 2171) / 8000, abs=1e-10)


@pytest.mark.parametrize(("n", "rate", "least"), [(30, 0.5, 0.945), (30, 0.9, 0.945), (100, 0.75, 0.945)])
def test_a_rate_is_covered_as_often_as_its_interval_says(n: int, rate: float, least: float) -> None:
    draws = np.random.default_rng(1).binomial(n, rate, size=4000)
    covered = {count: clopper_pearson(Ratio(count, n)) for count in set(draws.tolist())}
    hits = [interval.lower <= rate <= interval.upper for k in draws.tolist() if (interval := covered[k])]
    assert least <= np.mean(hits) <= 0.995


def test_the_bootstrap_covers_nearly_as_often_as_it_says() -> None:
    random = np.random.default_rng(2)
    hits = []
    for _ in range(600):
        result = mean_change(random.choice([-1, 0, 1], size=100, p=[0.25, 0.7, 0.05]))
        assert result is not None
        hits.append(result.lower <= -0.2 <= result.upper)
    assert 0.92 <= np.mean(hits) <= 0.975


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
