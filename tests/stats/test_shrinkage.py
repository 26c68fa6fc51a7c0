"""Groups with few pairs, drawn together: properties and simulated coverage."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from pytest_libero_max.stats.shrinkage import LEAST_GROUPS, critical_values, shrunken

EIGHT = np.repeat([f"event {number}" for number in range(8)], 10)


@pytest.mark.parametrize("bias", [0.0, 0.25, 1.0, 4.0])
def test_no_spread_of_the_bias_misses_more_often_than_the_level(bias: float) -> None:
    (width,) = critical_values(np.asarray([bias]), 0.05)
    rng = np.random.default_rng(7)
    worst = 0.0
    for _ in range(4000):
        shares = rng.dirichlet([0.3, 0.3, 0.3])
        at = rng.exponential(size=3) * [0, 1, 1]
        at *= np.sqrt(bias / max((shares * at**2).sum(), 1e-12))
        worst = max(worst, float((shares * (norm.sf(width - at) + norm.cdf(-width - at))).sum()))
    assert 0.045 < worst < 0.0501
    assert bias or width == pytest.approx(norm.ppf(0.975), abs=1e-6)


def test_equal_groups_are_drawn_to_their_mean_and_unlike_ones_stay_apart() -> None:
    rng = np.random.default_rng(4)
    alike = shrunken(-(rng.random(80) < 0.3).astype(int), EIGHT)
    apart = shrunken(np.where(EIGHT < "event 4", -1, 0) + (rng.random(80) < 0.05), EIGHT)
    assert alike is not None
    assert apart is not None
    assert max(group.weight for group in alike.values()) < 0.6
    assert min(group.weight for group in apart.values()) > 0.9
    for group in [*alike.values(), *apart.values()]:
        assert -1 <= group.lower <= group.value <= group.upper <= 1
        assert abs(group.value - group.raw) <= 1


def test_a_group_with_more_pairs_keeps_more_of_its_own_mean() -> None:
    rng = np.random.default_rng(5)
    labels = np.repeat(["a", "b", "c", "d", "e", "f"], [2, 4, 8, 16, 32, 64])
    found = shrunken(rng.integers(-1, 1, len(labels)), labels)
    assert found is not None
    assert found["f"].weight > found["d"].weight > found["a"].weight


def test_nothing_is_said_of_few_groups_or_of_pairs_that_are_all_alike() -> None:
    labels = np.repeat(["a", "b", "c", "d"], 5)
    assert len(set(labels)) < LEAST_GROUPS
    assert shrunken(np.tile([0, -1], 10), labels) is None
    assert shrunken(np.zeros(80, dtype=int), EIGHT) is None


LOSSES = {
    "as pi_0.5 loses to the events": np.array([0.01, 0.25, 0.04, 0.24, 0.36, 0.15, 0.13, 0.06]),
    "all alike": np.full(8, 0.2),
    "two of eight": np.array([0, 0, 0, 0, 0.98, 0.69, 0.02, 0.02]),
}


@pytest.mark.parametrize("losses", LOSSES.values(), ids=LOSSES)
@pytest.mark.parametrize("pairs", [4, 10])
def test_the_intervals_hold_on_average_over_the_groups(losses: NDArray[np.float64], pairs: int) -> None:
    """The lowest average that was found in such cells is 92.5%; single groups are held less often."""
    rng = np.random.default_rng(6)
    labels, probability = np.repeat([f"{number}" for number in range(8)], pairs), np.repeat(losses, pairs)
    held = raw = drawn = runs = 0.0
    for _ in range(60):
        found = shrunken(-(rng.random(len(labels)) < probability).astype(int), labels)
        if found is None:
            continue
        runs += 8
        for truth, group in zip(-losses, found.values(), strict=True):
            held += group.lower <= truth <= group.upper
            raw += (group.raw - truth) ** 2
            drawn += (group.value - truth) ** 2
    assert runs > 400
    assert held / runs > 0.9
    if losses is not LOSSES["two of eight"]:
        assert drawn < raw, "the estimates are nearer to the truth than the raw ones"
