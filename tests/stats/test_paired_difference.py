from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pytest_libero_max.stats import paired_difference as paired_difference_module
from pytest_libero_max.stats.paired_difference import exact, paired_difference, paired_differences
from pytest_libero_max.stats.significance import mcnemar
from tests.stats.other_intervals import agresti_min, exact_holds, newcombe, tango, tango_score
from tests.stats.unconditional import tables, tail_probabilities, unconditional


@st.composite
def counts(draw: st.DrawFn, most: int = 400) -> tuple[int, int, int]:
    """Losses, gains and pairs."""
    pairs = draw(st.integers(1, most))
    losses = draw(st.integers(0, pairs))
    return losses, draw(st.integers(0, pairs - losses)), pairs


@pytest.mark.parametrize(
    ("losses", "gains", "pairs", "confidence", "lower", "upper"),
    [
        # T. Tango (1998), Statistics in Medicine 17:891-908, sections 6.1 and 6.2.
        (1, 0, 44, 0.9, -0.096, 0.037),
        (3, 9, 32, 0.95, -0.027, 0.390),
        # A. Agresti and Y. Min (2005), Statistics in Medicine 24:729-740.
        (8, 16, 86, 0.95, -0.020, 0.207),
        # M. W. Fagerland, S. Lydersen and P. Laake (2014), Statistics in Medicine 33:2850-2875, table II.
        (7, 1, 21, 0.95, -0.517, -0.026),
    ],
)
def test_tango_gives_the_published_values(
    losses: int, gains: int, pairs: int, confidence: float, lower: float, upper: float
) -> None:
    assert tango(losses, gains, pairs, confidence) == pytest.approx((lower, upper), abs=5.1e-4)


@pytest.mark.parametrize(
    ("losses", "gains", "pairs", "preserved", "lower", "upper"),
    [
        # R. G. Newcombe (1998), Statistics in Medicine 17:2635-2650, method 10.
        (2, 12, 50, 20, 0.0562, 0.3292),
        # M.-L. Tang, M.-H. Ling, L. Ling and G. Tian (2010), Statistics in Medicine 29:46-62.
        (1, 3, 14, 8, -0.1574, 0.4136),
        # Fagerland, Lydersen and Laake (2014), as above.
        (7, 1, 21, 1, -0.507, -0.026),
    ],
)
def test_newcombe_gives_the_published_values(
    losses: int, gains: int, pairs: int, preserved: int, lower: float, upper: float
) -> None:
    assert newcombe(losses, gains, pairs, preserved) == pytest.approx((lower, upper), abs=5.1e-4)


def test_agresti_and_min_give_the_values_of_their_formula() -> None:
    # The example of diffpropci.mp in the R package PropCIs 0.3-0: b = 40, c = 20, n = 160.
    assert agresti_min(40, 20, 160) == pytest.approx((-0.216017, -0.030896), abs=1e-6)


@pytest.mark.parametrize("pairs", [1, 4, 32, 1000, 8000])
def test_pairs_that_are_all_alike_leave_a_width(pairs: int) -> None:
    interval = paired_difference(0, 0, pairs)
    reach = 1 - 0.025 ** (1 / pairs)
    assert interval is not None
    assert (interval.lower, interval.upper) == pytest.approx((-reach, reach), abs=6e-10)


def test_no_pairs_have_no_interval() -> None:
    assert paired_difference(0, 0, 0) is None


@given(counts())
def test_losses_alone_have_clopper_and_pearsons_bound(table: tuple[int, int, int]) -> None:
    losses, _, pairs = table
    lower, _ = exact(losses, 0, pairs)
    expected = stats.binomtest(losses, pairs).proportion_ci(0.95, method="exact").high
    assert lower == pytest.approx(-expected, abs=1e-9)


@settings(deadline=None)
@given(counts())
def test_the_interval_and_the_exact_test_agree(table: tuple[int, int, int]) -> None:
    losses, gains, pairs = table
    lower, upper = exact(losses, gains, pairs)
    p_value = 10 ** mcnemar(losses, gains)
    excluded = bool(lower > 1e-9 or upper < -1e-9)
    assert excluded == (p_value is not None and p_value < 0.05)


@settings(deadline=None)
@given(counts())
def test_the_interval_holds_its_estimate_and_has_a_width(table: tuple[int, int, int]) -> None:
    losses, gains, pairs = table
    for method in (exact, tango):
        lower, upper = method(losses, gains, pairs)
        assert -1 <= lower <= (gains - losses) / pairs + 1e-9
        assert (gains - losses) / pairs - 1e-9 <= upper <= 1
        assert lower < upper


@settings(deadline=None)
@given(counts())
def test_exchanging_the_conditions_mirrors_the_interval(table: tuple[int, int, int]) -> None:
    losses, gains, pairs = table
    for method in (exact, tango, agresti_min):
        lower, upper = method(losses, gains, pairs)
        low, high = method(gains, losses, pairs)
        assert (float(low), float(high)) == pytest.approx((-float(upper), -float(lower)), abs=1e-9)


@settings(deadline=None)
@given(counts(60), st.floats(-0.99, 0.99))
def test_asking_whether_the_interval_holds_a_value_is_looking_between_its_ends(
    table: tuple[int, int, int], value: float
) -> None:
    lower, upper = exact(*table)
    if min(abs(value - lower), abs(value - upper)) > 1e-8:
        assert exact_holds(value, *table) == (lower <= value <= upper)


@pytest.mark.parametrize(
    ("losses", "gains", "pairs"), [(2, 9, 161), (20, 40, 160), (1, 3, 5), (300, 20, 900)]
)
def test_the_bound_is_the_quantile_of_simulated_products(losses: int, gains: int, pairs: int) -> None:
    random, draws, m = np.random.default_rng(4), 400_000, losses + gains
    share = random.beta(gains + 1, losses, draws)
    larger, smaller = random.beta(m + 1, pairs - m, draws), random.beta(m, pairs - m + 1, draws)
    products = np.where(share > 0.5, larger, smaller) * (2 * share - 1)
    _, upper = exact(losses, gains, pairs)
    assert np.mean(products > upper) == pytest.approx(0.025, abs=0.001)


def test_many_intervals_at_once_are_those_of_one_after_the_other() -> None:
    table = np.array([(0, 0, 4), (4, 0, 4), (0, 4, 4), (2, 2, 4), (2171, 177, 8000), (0, 1, 1), (3, 1, 9000)])
    lower, upper = exact(*table.T)
    for row, low, high in zip(table.tolist(), lower.tolist(), upper.tolist(), strict=True):
        assert exact(*row) == pytest.approx((low, high), abs=1e-10)


def test_several_reported_intervals_are_the_single_ones() -> None:
    table = [(1, 0, 4), (0, 0, 0), (20, 40, 160)]
    several = paired_differences(table)
    paired_difference_module._KNOWN.clear()
    assert several == [paired_difference(*row) for row in table]
    assert paired_differences([]) == []


def test_the_score_is_mcnemars_without_a_difference() -> None:
    assert tango_score(0, 3, 9, 32) == pytest.approx(6 / np.sqrt(12))
    assert tango_score(0, 0, 0, 32) == 0


def test_the_tails_of_the_unconditional_test_are_those_of_all_tables() -> None:
    pairs, difference = 5, -0.3
    losses, gains = tables(pairs)
    score = np.round(tango_score(difference, losses, gains, pairs), 9)
    largest = np.zeros(len(losses))
    for loss in np.linspace(0.3, 0.65, 101):
        rates = [loss, loss - 0.3, 1.3 - 2 * loss]
        mass = stats.multinomial.pmf(np.stack([losses, gains, pairs - losses - gains], 1), pairs, rates)
        tails = [mass[score >= one].sum() for one in score]
        largest = np.maximum(largest, tails)
    assert tail_probabilities(pairs, difference)[0] == pytest.approx(largest, abs=1e-9)


def test_the_unconditional_interval_is_where_its_tails_are_a_fortieth() -> None:
    interval = unconditional(1, 0, 6)
    losses, gains = tables(6)
    (row,) = np.flatnonzero((losses == 1) & (gains == 0))
    assert tail_probabilities(6, interval.lower + 1e-6)[0][row] > 0.025
    assert tail_probabilities(6, interval.lower - 1e-6)[0][row] <= 0.025
    assert tail_probabilities(6, interval.upper - 1e-6)[1][row] > 0.025
    assert tail_probabilities(6, interval.upper + 1e-6)[1][row] <= 0.025
