from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.two_proportions import stratified_difference


def test_one_stratum_has_the_published_interval() -> None:
    """Newcombe (1998), Statistics in Medicine 17:873-890, Table II: 56/70 and 48/80."""
    found = stratified_difference([(Ratio(56, 70), Ratio(48, 80))])
    assert found.value == pytest.approx(0.2)
    assert (found.interval.lower, found.interval.upper) == pytest.approx((0.0528, 0.3382), abs=5e-5)


def test_strata_are_weighted_by_their_smaller_side() -> None:
    found = stratified_difference([(Ratio(10, 10), Ratio(0, 10)), (Ratio(0, 30), Ratio(0, 10))])
    assert found.value == pytest.approx(5.0 / (5.0 + 7.5))


def test_sides_exchanged_are_the_negative() -> None:
    strata = [(Ratio(9, 12), Ratio(3, 8)), (Ratio(1, 5), Ratio(2, 20))]
    found = stratified_difference(strata)
    other = stratified_difference([(second, first) for first, second in strata])
    assert other.value == pytest.approx(-found.value)
    assert (other.interval.lower, other.interval.upper) == pytest.approx(
        (-found.interval.upper, -found.interval.lower), abs=1e-6
    )
    assert other.log10_p == pytest.approx(found.log10_p, abs=1e-6)


def test_the_interval_has_a_width_where_nothing_varies() -> None:
    equal = stratified_difference([(Ratio(20, 20), Ratio(20, 20))] * 32)
    assert (equal.value, equal.log10_p) == (0.0, 0.0)
    assert equal.interval.lower == pytest.approx(-equal.interval.upper)
    assert 0.005 < equal.interval.upper < 0.007
    apart = stratified_difference([(Ratio(20, 20), Ratio(0, 20))] * 2)
    assert apart.interval.upper == 1.0
    assert 0.8 < apart.interval.lower < 0.95


def test_zero_is_outside_where_p_is_small() -> None:
    for count in range(21):
        found = stratified_difference([(Ratio(12, 20), Ratio(count, 20)), (Ratio(5, 9), Ratio(4, 9))])
        outside = not found.interval.lower <= 0 <= found.interval.upper
        assert outside == (10**found.log10_p < 0.05)


@pytest.mark.parametrize(("size", "strata", "rate"), [(15, 32, 0.7), (30, 32, 0.98), (1, 200, 0.5)])
def test_it_covers_about_as_often_as_it_says(size: int, strata: int, rate: float) -> None:
    draw, runs, gap = np.random.default_rng(4), 60, 0.02
    covered = 0
    for _ in range(runs):
        old, new = draw.binomial(size, rate, strata), draw.binomial(size, rate - gap, strata)
        found = stratified_difference(
            [(Ratio(int(x), size), Ratio(int(y), size)) for x, y in zip(old, new, strict=True)]
        )
        covered += found.interval.lower <= gap <= found.interval.upper
    assert covered / runs >= 0.88


def test_a_stratum_without_an_episode_is_refused() -> None:
    for strata in ([], [(Ratio(0, 0), Ratio(1, 2))]):
        with pytest.raises(ReportError, match="each side"):
            stratified_difference(strata)
