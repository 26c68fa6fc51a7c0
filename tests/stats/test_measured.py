from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.stats.blocks import Outcomes
from pytest_libero_max.stats.measured import tabulate
from pytest_libero_max.stats.ratios import Ratio

PAIRED = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=60)


def test_the_four_outcomes_are_told_apart() -> None:
    base = [True] * 5 + [False] * 5
    dynamic = [True, True, True, False, False, True, False, False, False, False]
    outcomes = tabulate(base, dynamic)
    assert outcomes == Outcomes(
        preserved_success=3, change_associated_success=1, regression=2, persistent_failure=4
    )
    assert outcomes.base == Ratio(5, 10)
    assert outcomes.dynamic == Ratio(4, 10)
    assert outcomes.change == Ratio(-1, 10)
    assert outcomes.conditional_regression == Ratio(2, 5)
    assert outcomes.retained == Ratio(4, 5)


def test_no_pairs_give_no_rates() -> None:
    outcomes = tabulate([], [])
    assert outcomes.total == 0
    for ratio in (outcomes.base, outcomes.change, outcomes.conditional_regression, outcomes.retained):
        assert ratio.value is None


def test_without_a_base_success_there_is_no_regression_rate() -> None:
    outcomes = tabulate([False, False], [True, False])
    assert outcomes.conditional_regression.value is None
    assert outcomes.retained.value is None
    assert outcomes.dynamic.value == 0.5


@given(PAIRED)
def test_the_rates_agree_with_one_another(pairs: list[tuple[bool, bool]]) -> None:
    outcomes = tabulate([pair[0] for pair in pairs], [pair[1] for pair in pairs])
    assert outcomes.total == len(pairs)
    assert outcomes.change.count == outcomes.dynamic.count - outcomes.base.count
    assert outcomes.change.count == outcomes.change_associated_success - outcomes.regression
    assert outcomes.preserved_success + outcomes.regression == outcomes.base.count
    assert all(ratio.of == len(pairs) for ratio in (outcomes.base, outcomes.dynamic, outcomes.change))


@given(st.data(), PAIRED)
def test_the_order_of_pairs_does_not_matter(data: st.DataObject, pairs: list[tuple[bool, bool]]) -> None:
    shuffled = data.draw(st.permutations(pairs))
    assert tabulate(*_columns(pairs)) == tabulate(*_columns(shuffled))


def _columns(pairs: list[tuple[bool, bool]]) -> tuple[list[bool], list[bool]]:
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]
