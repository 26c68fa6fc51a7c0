"""Flips beyond a policy's own chance, estimated without bias."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sham import _chance_of, unrepeatable_texts


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


def texts(chance: Any, *, repeatable: bool = False) -> list[str]:
    sham = None if chance is None else SimpleNamespace(pairs=chance.flips.of, chance=chance)
    report = SimpleNamespace(policy={"repeatable": repeatable}, sham=sham, pairs=SimpleNamespace(played=40))
    return unrepeatable_texts(cast("Report", report))


def ended(**counts: int) -> Any:
    """Pairs by the ends of Base, Dynamic, and both again, as letters: ``s`` for a success."""
    names = ("base", "dynamic", "sham", "sham_dynamic")
    return _chance_of(
        [
            cast(
                "Any",
                SimpleNamespace(
                    arms={name: Ended(letter == "s") for name, letter in zip(names, ends, strict=True)}
                ),
            )
            for ends, count in counts.items()
            for _ in range(count)
        ]
    )


def test_a_floor_as_large_as_the_effect_is_called_so() -> None:
    _, said = texts(ended(ssss=10, sfff=3, sssf=4, sffs=3))
    assert said == (
        "THE FLOOR IS AS LARGE AS THE EFFECT ON SINGLE PAIRS: of 20 pairs that were played twice, Base and "
        "Dynamic end differently in 30.0%, and two plays of the same arm in 32.5%. This policy's own chance"
        " alone makes as many lost and gained pairs: read the paired change with its interval, and no "
        "single pair."
    )
    _, said = texts(ended(ssss=10, sfff=8, fsss=2))
    assert said == (
        "THE FLOOR MAY BE AS LARGE AS THE EFFECT ON SINGLE PAIRS: of 20 pairs that were played twice, Base "
        "and Dynamic end differently in 50.0%, and two plays of the same arm in 25.0%. What is beyond "
        "chance, +0.0 pp [-16.8, +16.8], is not shown to be above 0: read the paired change with its "
        "interval, and no single pair."
    )


def test_a_smaller_floor_is_compared_and_none_of_a_policy_that_repeats_itself() -> None:
    assert texts(ended(ssss=10, sfff=8, fsss=2), repeatable=True) == []
    assert len(texts(ended(ssff=0, sfsf=30, ssss=10))) == 1
    (unknown,) = texts(None)
    assert unknown.endswith("size of this chance is not known: --libero-max-noise=sham:1.")
    assert "40 of 40 pairs measure it" in texts(ended(sfsf=30, ssss=10))[0]
