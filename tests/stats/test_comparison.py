from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.stats.comparison import (
    contrasts,
    group_change_contrasts,
    group_contrasts,
    profile_agreement,
    rank_sets,
    ranks,
    sign_flip,
)


def test_a_contrast_counts_who_succeeds_where() -> None:
    (contrast,) = contrasts({"a": [True, True, False, False, True], "b": [True, False, True, True, True]})
    assert (contrast.first, contrast.second) == ("a", "b")
    assert (contrast.first_only, contrast.second_only) == (1, 2)
    assert contrast.difference.value == pytest.approx(0.2)
    assert contrast.p_value == 1.0


def test_holm_is_over_the_contrasts_made() -> None:
    column = np.arange(40) % 2 == 0
    successes = {"a": column, "b": np.ones(40, dtype=bool), "c": np.ones(40, dtype=bool)}
    three = {(c.first, c.second): c for c in contrasts(successes)}
    assert three["b", "c"].log10_p_value_holm == 0, "no discordant pair, p = 1"
    single = three["a", "b"].log10_p_value
    assert single is not None
    assert three["a", "b"].log10_p_value_holm == pytest.approx(single + np.log10(3))
    (alone,) = contrasts(successes, pairs=[("a", "b")])
    assert alone.log10_p_value_holm == pytest.approx(single)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=50))
def test_exchanging_the_sides_changes_the_sign_only(rows: list[tuple[bool, bool]]) -> None:
    a, b = [row[0] for row in rows], [row[1] for row in rows]
    (forward,), (backward,) = contrasts({"a": a, "b": b}), contrasts({"b": b, "a": a})
    assert forward.log10_p_value == backward.log10_p_value
    assert forward.difference.value is not None
    assert backward.difference.value is not None
    assert forward.difference.value == -backward.difference.value


def test_ranks_share_ties_and_leave_out_what_is_unknown() -> None:
    assert ranks({"a": 0.5, "b": 0.9, "c": 0.5, "d": None}) == {"a": 2.5, "b": 1.0, "c": 2.5, "d": None}
    assert ranks({}) == {}


def test_rank_sets_hold_every_rank_that_is_not_shown_to_be_wrong() -> None:
    best, poor = np.arange(100) < 100, np.arange(100) < 20
    successes = {"a": best, "b": np.arange(100) < 98, "c": poor, "partial": np.arange(100) < 50}
    assert rank_sets(["a", "b", "c"], contrasts(successes)) == {"a": (1, 2), "b": (1, 2), "c": (3, 3)}
    assert rank_sets(["a"], contrasts({"a": best, "partial": poor})) == {"a": (1, 1)}


def test_rank_sets_together_hold_the_true_ranks() -> None:
    random = np.random.default_rng(5)
    rates = {"a": 0.85, "b": 0.6, "c": 0.55, "d": 0.3}
    held = 0
    for _ in range(60):
        drawn = {name: random.random(80) < rate for name, rate in rates.items()}
        sets = rank_sets(list(rates), contrasts(drawn))
        held += all(low <= rank <= high for rank, (low, high) in enumerate(sets.values(), 1))
    assert held >= 57


def test_profiles_that_order_alike_and_contrarily() -> None:
    agreement = profile_agreement({"a": [1, 2, 3], "b": [10, 20, 90], "c": [3, 2, 1], "d": [0, 0, 0]})
    assert agreement.correlations["a", "b"] == pytest.approx(1)
    assert agreement.correlations["a", "c"] == pytest.approx(-1)
    assert agreement.correlations["a", "d"] is None
    assert agreement.mean == pytest.approx(-1 / 3)
    assert profile_agreement({"a": [1, 2]}).mean is None


def test_the_sign_flip_test_counts_all_sign_changes() -> None:
    for differences in ([1, 1, 2, -1], [2, 2, 0], [0, 0], [-2, 1, 1, 1, 0, -1], [1] * 7):
        sums = [
            sum(s * d for s, d in zip(signs, differences, strict=True))
            for signs in product((-1, 1), repeat=len(differences))
        ]
        expected = np.mean([abs(total) >= abs(sum(differences)) for total in sums])
        log10_p = sign_flip(differences)
        assert log10_p == pytest.approx(math.log10(expected), abs=1e-12)
    assert sign_flip([]) is None


def test_contrasts_of_groups_are_one_family() -> None:
    truth = np.ones(20, dtype=bool)
    lost = truth.copy()
    lost[:10] = False
    groups = {"first": np.arange(20) < 10, "second": np.arange(20) >= 10, "none": np.zeros(20, dtype=bool)}
    found = group_contrasts({"a": truth, "b": lost}, groups)
    (first,), (second,), (none,) = found["first"], found["second"], found["none"]
    assert (first.cases, first.difference.value, second.difference.value) == (10, -1.0, 0.0)
    assert first.log10_p_value_holm == pytest.approx(math.log10(2 * 2 * 0.5**10))
    assert (none.cases, none.difference.value, none.log10_p_value_holm) == (0, None, None)
    assert none.difference.simultaneous.lower is None
    changes = group_change_contrasts({"a": truth, "b": truth}, {"a": truth, "b": lost}, groups)
    assert changes["first"][0].difference.value == -1.0
    assert changes["first"][0].log10_p_value_holm == pytest.approx(first.log10_p_value_holm)
