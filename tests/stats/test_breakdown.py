from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pytest_libero_max.stats.blocks import Outcomes
from pytest_libero_max.stats.breakdown import (
    breakdown,
    largest_split,
    lowest_by_chance,
    macro_average,
    split_by_chance,
)
from pytest_libero_max.stats.measured import at_floor
from pytest_libero_max.stats.paired import Pairs, measure

FATES = st.lists(st.tuples(st.integers(0, 5), st.sampled_from(["plus", "pro"])), max_size=40)


def _pairs(fates: list[tuple[int, str]]) -> Pairs:
    """Fates 0 to 3 are the outcomes with a response, 4 and 5 pairs whose event never fired."""
    kinds = [fate for fate, _ in fates]
    return Pairs.of(
        base=[kind in (0, 1, 4) for kind in kinds],
        dynamic=[kind in (0, 2, 4) for kind in kinds],
        triggered=[kind < 4 for kind in kinds],
        responded=[kind < 4 for kind in kinds],
        stale=[kind if kind < 4 else -1 for kind in kinds],
        source=[source for _, source in fates],
        task=[f"task {kind}" for kind in kinds],
    )


@settings(deadline=None)
@given(FATES)
def test_every_assigned_pair_is_in_every_denominator(fates: list[tuple[int, str]]) -> None:
    result = measure(_pairs(fates))
    n = len(fates)
    assert result.outcomes.total == n
    assert result.trigger_coverage.of == result.response_coverage.of == n
    assert result.outcomes.base.of == result.outcomes.dynamic.of == result.outcomes.change.of == n
    assert result.stale_actions.pairs + result.stale_actions.unanswered == result.trigger_coverage.count
    assert result.given_response.outcomes.total == result.response_coverage.count
    change = result.paired_change
    assert (change.lower is None) == (n == 0)
    if change.lower is not None:
        assert change.value is not None
        assert change.upper is not None
        assert change.lower < change.upper
        assert change.lower <= change.value <= change.upper
        assert change.bootstrap.lower is not None


@settings(deadline=None, max_examples=30)
@given(FATES)
def test_groups_add_up_to_the_whole(fates: list[tuple[int, str]]) -> None:
    pairs = _pairs(fates)
    groups = breakdown(pairs, pairs.source, ["plus", "pro"])
    whole = measure(pairs)
    for name in ("preserved_success", "change_associated_success", "regression", "persistent_failure"):
        total = sum(getattr(group.outcomes, name) for group in groups.values())
        assert total == getattr(whole.outcomes, name)


@settings(deadline=None, max_examples=30)
@given(st.data(), FATES)
def test_the_order_of_pairs_never_shows(data: st.DataObject, fates: list[tuple[int, str]]) -> None:
    assert measure(_pairs(fates)) == measure(_pairs(data.draw(st.permutations(fates))))


def test_a_macro_average_weighs_groups_alike() -> None:
    small, large = Outcomes(1, 0, 0, 0), Outcomes(0, 0, 50, 50)
    macro = macro_average([small, large])
    assert (macro.base_success, macro.dynamic_success, macro.paired_change) == (0.75, 0.5, -0.25)
    assert macro.groups == 2


def test_a_macro_average_over_an_empty_group_does_not_exist() -> None:
    assert macro_average([Outcomes(1, 0, 0, 0), Outcomes(0, 0, 0, 0)]).paired_change is None
    assert macro_average([]).base_success is None


def test_the_largest_split_is_within_one_event() -> None:
    split = largest_split(
        {
            "camera_shift": {"v0": Outcomes(9, 0, 1, 0), "v1": Outcomes(5, 0, 5, 0)},
            "obstacle_insertion": {"v0": Outcomes(9, 0, 1, 0), "v1": Outcomes(1, 1, 4, 4)},
            "sensor_noise_onset": {"v0": Outcomes(10, 0, 0, 0), "v1": Outcomes(0, 0, 0, 0)},
        }
    )
    assert split is not None
    assert split.event == "obstacle_insertion"
    assert split.dynamic_success == {"v0": 0.9, "v1": 0.2}
    assert split.difference == pytest.approx(0.7)
    assert largest_split({"camera_shift": {"v0": Outcomes(1, 0, 0, 0)}}) is None


def test_the_floor_is_a_fifth_of_base_success() -> None:
    assert at_floor(Outcomes(19, 0, 0, 81)) is True
    assert at_floor(Outcomes(20, 0, 0, 80)) is False
    assert at_floor(Outcomes(0, 0, 0, 0)) is None


def test_the_lowest_of_groups_by_chance_is_what_the_binomial_says() -> None:
    found = lowest_by_chance([400] * 10, 2000, 0, seen=0.4)
    draws = stats.binom.rvs(400, 0.5, size=(4000, 10), random_state=1) / 400
    assert found.expected == pytest.approx(draws.min(axis=1).mean(), abs=0.003)
    assert not found.explains
    assert lowest_by_chance([400] * 10, 2000, 0, seen=0.47).explains


def test_losses_and_gains_are_dealt_together() -> None:
    found = lowest_by_chance([50] * 17, 42, 42, seen=-0.1)
    assert -0.12 < found.expected < -0.04
    assert found.explains
    assert not lowest_by_chance([50] * 17, 42, 42, seen=-0.3).explains


def test_the_largest_split_by_chance_grows_with_small_cells() -> None:
    small = split_by_chance([([2, 2], 2)] * 8, seen=0.5)
    large = split_by_chance([([50, 50], 75)] * 8, seen=0.5)
    assert small.expected > 0.5
    assert large.expected == pytest.approx(0.16, abs=0.03)
    assert small.explains
    assert not large.explains
    assert np.isfinite(small.share)
