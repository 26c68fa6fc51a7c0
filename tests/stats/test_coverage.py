from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pytest_libero_max.stats.intervals import mean_change
from pytest_libero_max.stats.paired_difference import exact
from tests.stats.coverage import (
    TaskCell,
    agresti_min_coverage,
    all_bounds,
    bootstrap_coverage,
    exact_coverage,
    likely_results,
    lowest_coverage,
    newcombe_coverage,
    rate_coverage,
    tango_coverage,
    task_misses,
    unconditional_coverage,
    wilson_coverage,
)
from tests.stats.other_intervals import newcombe
from tests.stats.unconditional import tables


@pytest.mark.parametrize("n", [4, 8, 32, 100])
def test_the_exact_interval_of_a_rate_holds_its_level_at_every_rate(n: int) -> None:
    rates = np.linspace(0.001, 0.999, 500).tolist()
    assert min(rate_coverage(n, rates)) >= 0.95
    assert min(wilson_coverage(n, rates)) < 0.93


@pytest.mark.parametrize(("mean", "spread"), [(0.02, np.inf), (0.3, 2.0)])
def test_an_interval_by_task_seldom_misses(mean: float, spread: float) -> None:
    for quantity in ("change", "rate", "lost"):
        missed, _ = task_misses(TaskCell(quantity, 40, mean, spread), runs=100)
        assert missed <= 0.085, quantity


def test_four_alike_pairs_hide_a_loss_from_the_bootstrap_and_not_from_the_exact_interval() -> None:
    for pairs, covered in ((4, 0.076), (32, 0.46), (100, 0.86)):
        assert bootstrap_coverage(pairs, 0.02, 0) == pytest.approx(covered, abs=0.02)
        assert exact_coverage(pairs, 0.02, 0) > 0.95


@pytest.mark.parametrize("pairs", [4, 9, 32])
def test_the_exact_interval_covers_at_least_the_nominal_share_of_every_true_effect(pairs: int) -> None:
    lowest, _ = lowest_coverage(all_bounds("exact", pairs), pairs, 0.05)
    assert lowest >= 0.95


@pytest.mark.parametrize(("loss", "gain"), [(0.0002, 0.0), (0.001, 0.005), (0.02, 0.0), (0.11, 0.005)])
def test_the_exact_interval_keeps_its_level_for_a_whole_track(loss: float, gain: float) -> None:
    assert exact_coverage(8000, loss, gain) >= 0.95


def test_tango_falls_below_what_is_wanted_where_the_exact_interval_does_not() -> None:
    assert tango_coverage(4, 0.956, 0) < 0.84 < 0.95 < exact_coverage(4, 0.956, 0)
    assert tango_coverage(1000, 0.004, 0) < 0.932 < 0.95 < exact_coverage(1000, 0.004, 0)


@pytest.mark.parametrize(("loss", "gain"), [(0.2, 0.03), (0.02, 0.0), (0.1, 0.1), (0.6, 0.4)])
@pytest.mark.parametrize("pairs", [5, 30])
def test_bisection_finds_the_coverage_that_all_results_have(pairs: int, loss: float, gain: float) -> None:
    losses, gains = tables(pairs)
    lower, upper = exact(losses, gains, pairs)
    results = np.stack([losses, gains, pairs - losses - gains], 1)
    mass = stats.multinomial.pmf(results, pairs, [loss, gain, 1 - loss - gain])
    held = (lower <= gain - loss) & (gain - loss <= upper)
    assert exact_coverage(pairs, loss, gain) == pytest.approx(mass[held].sum(), abs=1e-9)


def test_enumeration_and_simulation_agree() -> None:
    random = np.random.default_rng(3)
    drawn = random.multinomial(40, [0.3, 0.1, 0.6], size=1500)
    held = []
    for losses, gains, alike in drawn.tolist():
        result = mean_change(np.repeat([-1, 0, 1], [losses, alike, gains]))
        assert result is not None
        held.append(result.lower <= -0.2 <= result.upper)
    assert bootstrap_coverage(40, 0.3, 0.1) == pytest.approx(np.mean(held), abs=0.025)


def test_newcombes_draws_agree_with_enumeration() -> None:
    loss, gain, pairs = 0.2, 0.05, 32
    drawn = np.random.default_rng(5).multinomial(pairs, [loss, gain, 0.375, 0.375], size=40_000)
    lower, upper = newcombe(drawn[:, 0], drawn[:, 1], pairs, drawn[:, 2])
    simulated = np.mean((lower <= gain - loss) & (gain - loss <= upper))
    assert newcombe_coverage(pairs, loss, gain) <= simulated + 0.005


def test_likely_results_have_all_of_the_probability() -> None:
    for pairs, loss, gain in ((8000, 0.1, 0.02), (8000, 0.01, 0.0), (5, 0.9, 0.1)):
        assert likely_results(pairs, loss, gain)[2].sum() == pytest.approx(1, abs=1e-9)


def test_every_method_covers_a_plain_effect_of_many_pairs() -> None:
    for coverage in (exact_coverage, tango_coverage, agresti_min_coverage, unconditional_coverage):
        assert 0.94 < coverage(100, 0.3, 0.1) < 0.98
