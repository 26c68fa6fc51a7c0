"""The interval of a mean of values from -2 to 2: exact where that is known, and its coverage elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pytest_libero_max.stats.bounded_mean import bounded_means, bounds, exceed
from tests.stats.change_coverage import VALUES, change_coverage, holds, joint_coverage, lowest_change_coverage


@pytest.mark.parametrize("confidence", [0.95, 1 - 0.05 / 1000])
@pytest.mark.parametrize("cases", [1, 2, 8, 100, 1000])
def test_of_two_values_it_is_clopper_and_pearsons(cases: int, confidence: float) -> None:
    for high in {0, 1, cases // 3, cases - 1, cases}:
        lower, upper = bounds([[cases - high, 0, 0, 0, high]], confidence)
        exact = stats.binomtest(high, cases).proportion_ci(confidence, "exact")
        assert lower[0] == pytest.approx(4 * exact.low - 2, abs=2e-5)
        assert upper[0] == pytest.approx(4 * exact.high - 2, abs=2e-5)


def test_alike_cases_have_a_width_and_none_have_no_interval() -> None:
    alike, none, mixed = bounded_means([[0] * 50, [], [1, 0, 0, -2]], 2)
    assert alike is not None
    assert alike.upper == -alike.lower == pytest.approx(2 * (1 - 0.025 ** (1 / 50)), abs=1e-6)
    assert none is None
    assert mixed is not None
    assert -2 <= mixed.lower < -0.25 < mixed.upper <= 2


def test_the_probability_of_a_weighted_mean_is_that_of_draws() -> None:
    random = np.random.default_rng(3)
    for counts in ([1, 3, 5, 2, 1], [0, 15, 2985, 0, 1], [0, 8, 992, 0, 1], [20, 1, 0, 0, 30]):
        shapes = np.asarray(counts, dtype=np.float64)
        drawn = random.dirichlet(shapes[shapes > 0], size=40_000) @ VALUES[shapes > 0]
        for tail in (0.3, 0.1, 0.02):
            limit = np.quantile(drawn, 1 - tail)
            found = exceed(shapes[None], VALUES, np.asarray([limit]))
            assert found == pytest.approx(tail, rel=5 * ((1 - tail) / (tail * 40_000)) ** 0.5)


def test_what_holds_is_what_lies_between_the_bounds() -> None:
    counts = np.random.default_rng(4).multinomial(60, [0.02, 0.2, 0.5, 0.25, 0.03], size=100)
    lower, upper = bounds(counts)
    for truth in (-0.3, 0.0, 0.07, 0.35):
        assert (holds(counts, truth) == ((lower <= truth) & (truth <= upper))).all()


@pytest.mark.parametrize("cases", [4, 8])
def test_no_true_effect_is_missed_more_often_than_the_level_says(cases: int) -> None:
    lowest, _ = lowest_change_coverage(cases, effects=300)
    assert lowest >= 0.95


@pytest.mark.parametrize("cases", [4, 12, 100])
def test_rare_and_large_differences_are_covered_singly_and_together(cases: int) -> None:
    """The interval that adds a made-up case on both sides held 91.6% here, and 84.5% of eight together."""
    for weights in ((0.02, 0, 0, 0), (0.1, 0, 0, 0), (0, 0.01, 0, 0)):
        assert change_coverage(cases, weights) >= 0.95
        assert joint_coverage(cases, weights) >= 0.95
