from __future__ import annotations

import sys
from math import comb

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pytest_libero_max.stats.power import detectable_loss, pairs_needed, power
from pytest_libero_max.stats.significance import mcnemar


def _enumerated(pairs: int, loss: float, gain: float) -> float:
    """Power by going through every outcome."""
    total = 0.0
    for losses in range(pairs + 1):
        for gains in range(pairs - losses + 1):
            p_value = 10 ** mcnemar(losses, gains)
            if p_value is not None and p_value <= 0.05:
                ways = comb(pairs, losses) * comb(pairs - losses, gains)
                total += ways * loss**losses * gain**gains * (1 - loss - gain) ** (pairs - losses - gains)
    return total


@pytest.mark.parametrize(
    ("pairs", "loss", "gain"), [(5, 0.9, 0.0), (12, 0.6, 0.05), (30, 0.3, 0.1), (25, 0.2, 0.2)]
)
def test_power_is_what_enumeration_finds(pairs: int, loss: float, gain: float) -> None:
    assert power(pairs, loss, gain) == pytest.approx(_enumerated(pairs, loss, gain), abs=1e-10)


def test_fewer_than_six_pairs_resolve_nothing() -> None:
    assert power(5, 1.0, 0.0) == 0.0
    assert power(6, 1.0, 0.0) == pytest.approx(1.0)


def test_power_is_what_simulation_finds() -> None:
    random = np.random.default_rng(5)
    draws = random.multinomial(200, [0.15, 0.05, 0.8], size=4000)
    rejected = {}
    for losses, gains in {(int(a), int(b)) for a, b, _ in draws}:
        p_value = 10 ** mcnemar(losses, gains)
        rejected[losses, gains] = p_value is not None and p_value <= 0.05
    share = np.mean([rejected[int(a), int(b)] for a, b, _ in draws])
    assert power(200, 0.15, 0.05) == pytest.approx(share, abs=0.025)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 3000), st.floats(0, 0.5), st.floats(0, 0.5))
@example(4, 0.0, sys.float_info.min)
@example(1, 0.0, 5e-324)
@example(3000, 0.5, 0.5)
def test_without_a_change_the_level_is_kept(pairs: int, loss: float, gain: float) -> None:
    assert power(pairs, loss, loss) <= 0.05 + 1e-9
    assert power(pairs, loss, gain) == pytest.approx(power(pairs, gain, loss), abs=1e-9)


def test_probabilities_may_sum_to_one_but_for_rounding() -> None:
    assert power(10, 0.5, 0.5 + 5e-13) == pytest.approx(power(10, 0.5, 0.5))


@pytest.mark.parametrize(("pairs", "target"), [(32, 0.8), (100, 0.8), (800, 0.9), (8000, 0.9)])
def test_the_detectable_loss_is_the_smallest(pairs: int, target: float) -> None:
    loss = detectable_loss(pairs, 0.02, target)
    assert loss is not None
    assert power(pairs, loss, 0.02) >= target
    assert power(pairs, loss - 2e-5, 0.02) < target


def test_more_pairs_resolve_smaller_changes() -> None:
    losses = [detectable_loss(pairs, 0.02, 0.8) for pairs in (32, 100, 800, 1000, 8000)]
    assert losses == sorted(losses, key=lambda loss: -(loss or 0))


def test_what_is_out_of_reach_is_none() -> None:
    assert detectable_loss(4, 0.0, 0.8) is None
    assert detectable_loss(100, 0.02, 0.8, base_rate=0.05) is None
    assert pairs_needed(0.02, 0.02, 0.8) is None


@pytest.mark.parametrize(("loss", "gain"), [(0.2, 0.03), (0.08, 0.05), (0.5, 0.0)])
def test_the_pairs_needed_suffice(loss: float, gain: float) -> None:
    pairs = pairs_needed(loss, gain, 0.8)
    assert pairs is not None
    assert power(pairs, loss, gain) >= 0.8
    assert power(max(1, pairs // 2), loss, gain) < 0.8
