from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.two_proportions import (
    _fisher,
    compare_proportions,
    episodes_for_power,
    episodes_to_show,
    pairs_to_show,
    stratified_difference,
)

ratios = st.integers(1, 60).flatmap(lambda n: st.builds(Ratio, st.integers(0, n), st.just(n)))


@given(ratios, ratios)
@settings(max_examples=60)
def test_interval_and_test_agree_and_are_those_of_scipy(first: Ratio, second: Ratio) -> None:
    found = compare_proportions(first, second)
    assert found.interval is not None
    assert found.log10_p is not None
    assert found.value is not None
    table = [[ratio.count, ratio.of - ratio.count] for ratio in (first, second)]
    tails = [stats.fisher_exact(table, way).pvalue for way in ("less", "greater")]
    assert 10**found.log10_p == pytest.approx(min(1.0, 2 * min(tails)), rel=1e-9)
    assert found.interval.lower <= found.value + 1e-9
    assert found.value - 1e-9 <= found.interval.upper
    p = 10**found.log10_p
    if abs(p - 0.05) > 1e-6:
        assert (found.interval.lower > 0 or found.interval.upper < 0) == (p < 0.05)
    turned = compare_proportions(second, first).interval
    assert turned is not None
    assert (turned.lower, turned.upper) == (-found.interval.upper, -found.interval.lower)


def test_the_interval_is_the_melded_one() -> None:
    """Against draws from the four confidence distributions, as the reference defines it."""
    found = compare_proportions(Ratio(9, 10), Ratio(3, 10)).interval
    random = np.random.default_rng(7)
    lower = random.beta(9, 2, 400_000) - random.beta(4, 7, 400_000)
    upper = random.beta(10, 1, 400_000) - random.beta(3, 8, 400_000)
    assert found is not None
    assert found.lower == pytest.approx(np.quantile(lower, 0.025), abs=0.003)
    assert found.upper == pytest.approx(np.quantile(upper, 0.975), abs=0.003)


def test_nothing_is_known_without_episodes() -> None:
    assert compare_proportions(Ratio(0, 0), Ratio(3, 4)).interval is None


def test_the_number_at_which_rates_are_significant_is_where_the_test_turns() -> None:
    n = episodes_to_show(0.78, 0.74)
    assert n is not None
    p = {
        size: compare_proportions(Ratio(int(0.78 * size), size), Ratio(-int(-0.74 * size), size))
        for size in (n, n // 2)
    }
    assert 10 ** (p[n].log10_p or 0.0) < 0.05 < 10 ** (p[n // 2].log10_p or 0.0)
    assert episodes_to_show(0.5, 0.5) is None
    assert pairs_to_show(0, 1, 10) == 60  # six discordant pairs, all on one side
    assert pairs_to_show(3, 3, 10) is None


def test_that_number_of_episodes_has_the_power() -> None:
    """The exact power of the test at the approximate number."""
    n = episodes_for_power(0.9, 0.7, 0.8)
    assert n is not None
    counts = np.arange(n + 1)
    first, second = stats.binom.pmf(counts, n, 0.9), stats.binom.pmf(counts, n, 0.7)
    rejected = sum(
        first[a] * second[b]
        for a in counts
        for b in counts
        if first[a] * second[b] > 1e-7 and 10 ** _fisher(Ratio(int(a), n), Ratio(int(b), n)) < 0.05
    )
    assert 0.78 < rejected < 0.83
    assert episodes_for_power(0.5, 0.5, 0.8) is None


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
