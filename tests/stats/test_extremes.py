from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pytest_libero_max.stats.extremes import lowest_by_chance, split_by_chance


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
