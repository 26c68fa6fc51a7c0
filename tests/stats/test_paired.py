from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.stats.paired import expose


def test_a_small_distribution() -> None:
    exposure = expose([0, 4, 4, 1, 3], unanswered=2)
    assert (exposure.pairs, exposure.unanswered) == (5, 2)
    assert exposure.mean == pytest.approx(2.4)
    assert exposure.median == 3
    assert exposure.quantiles == {"0.05": 0, "0.25": 1, "0.75": 4, "0.95": 4}
    assert exposure.histogram == {"0": 1, "1": 1, "3": 1, "4": 2}


def test_without_a_pair_nothing_is_invented() -> None:
    exposure = expose([])
    assert exposure.mean is None
    assert exposure.median is None
    assert set(exposure.quantiles.values()) == {None}
    assert exposure.histogram == {}


@given(st.lists(st.integers(0, 60), min_size=1, max_size=80))
def test_the_histogram_holds_every_pair_and_quantiles_were_observed(stale: list[int]) -> None:
    exposure = expose(stale)
    assert sum(exposure.histogram.values()) == len(stale)
    assert list(map(int, exposure.histogram)) == sorted(set(stale))
    assert set(exposure.quantiles.values()) <= set(stale)
    assert exposure.mean == pytest.approx(sum(stale) / len(stale))
