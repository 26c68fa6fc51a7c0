"""Flips beyond a policy's own chance, estimated without bias."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.report.sham import _chance_of


class Ended(SimpleNamespace):
    """An arm of which only the end is known."""

    def __init__(self, success: bool) -> None:
        super().__init__(success=success)


def records(base: float, dynamic: float, pairs: int) -> Any:
    """Pairs whose four rollouts succeed with these probabilities."""
    draws = np.random.default_rng(1).random((pairs, 4)) < (base, dynamic, base, dynamic)
    names = ("base", "dynamic", "sham", "sham_dynamic")
    return [
        SimpleNamespace(
            arms={name: SimpleNamespace(success=end) for name, end in zip(names, row, strict=True)}
        )
        for row in draws
    ]


@pytest.mark.parametrize(("base", "dynamic"), [(0.5, 0.5), (0.9, 0.2), (1.0, 0.0), (0.8, 0.6)])
def test_flips_less_the_floor_are_the_square_of_the_effect(base: float, dynamic: float) -> None:
    chance: Any = _chance_of(records(base, dynamic, 20_000))
    assert chance.beyond.value == pytest.approx((base - dynamic) ** 2, abs=0.02)
    assert chance.beyond.lower <= (base - dynamic) ** 2 <= chance.beyond.upper
    assert chance.floor == pytest.approx(base * (1 - base) + dynamic * (1 - dynamic), abs=0.02)
    assert chance.flips.value == pytest.approx(chance.beyond.value + chance.floor, abs=0.03)


def test_nothing_is_said_of_pairs_that_were_not_played_twice() -> None:
    assert _chance_of([]) is None
