"""Fillings against the definition: every cell full, nothing used twice, no filling more even or cheaper."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max.makers.construction.matching import (
    Flags,
    Integers,
    Shortage,
    fill,
    levelled,
    most_even,
)

Problem = tuple[Flags, Integers, Integers, Integers]


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    """At most six tasks, three cells, three levels: small enough to try every filling."""
    tasks, cells = draw(st.integers(1, 6)), draw(st.integers(1, 3))
    bits = st.lists(st.booleans(), min_size=tasks * cells, max_size=tasks * cells)
    numbers = st.lists(st.integers(0, 10**6), min_size=tasks * cells, max_size=tasks * cells, unique=True)
    return (
        np.array(draw(bits)).reshape(tasks, cells),
        np.array(draw(st.lists(st.integers(0, 2), min_size=cells, max_size=cells))),
        np.array(draw(st.lists(st.integers(0, 2), min_size=tasks, max_size=tasks))),
        np.array(draw(numbers)).reshape(tasks, cells),
    )


def every_filling(fits: Flags, need: Integers) -> set[tuple[int, ...]]:
    """Each as the cell of each task, -1 for none."""
    tasks, slots = len(fits), np.repeat(np.arange(len(need)), need).tolist()
    if len(slots) > tasks:
        return set()
    orders = set(permutations(slots + [-1] * (tasks - len(slots))))
    return {order for order in orders if all(cell < 0 or fits[i, cell] for i, cell in enumerate(order))}


def unevenness(found: tuple[int, ...], levels: Integers) -> int:
    return int((np.bincount(levels[np.array(found) >= 0]) ** 2).sum())


@settings(deadline=None)  # the first call imports SciPy
@given(problems())
def test_the_best_of_all_fillings_is_found(problem: Problem) -> None:
    fits, need, levels, cost = problem
    fillings = every_filling(fits, need)
    if not fillings:
        with pytest.raises(Shortage) as caught:
            fill(*problem)
        cells = list(caught.value.cells)
        assert caught.value.needed == need[cells].sum() > caught.value.there
        assert caught.value.there == fits[:, cells].any(axis=1).sum()
        return
    found = tuple(fill(*problem).tolist())
    assert found in fillings
    assert unevenness(found, levels) == min(unevenness(one, levels) for one in fillings)
    taken = most_even(fits, need, levels)

    def price(one: tuple[int, ...]) -> float:
        if (np.bincount(levels[np.array(one) >= 0], minlength=len(taken)) != taken).any():
            return float("inf")
        return float(sum(cost[task, cell] for task, cell in enumerate(one) if cell >= 0))

    assert price(found) == min(map(price, fillings))


def test_levels_rise_from_the_lowest_as_far_as_the_supply_goes() -> None:
    assert levelled(np.array([9, 2, 9]), 7).tolist() == [3, 2, 2]


def test_a_scarce_level_gives_all_it_can() -> None:
    fits = np.ones((9, 1), dtype=bool)
    levels = np.array([0, 1, 1, 1, 1, 2, 2, 2, 2])
    assert most_even(fits, np.array([7]), levels).tolist() == [1, 3, 3]


def test_a_level_that_only_full_cells_can_use_gives_what_fits() -> None:
    fits = np.array([[True, False]] * 3 + [[True, True]] * 3)
    levels = np.array([0, 0, 0, 1, 1, 1])
    assert most_even(fits, np.array([1, 3]), levels).tolist() == [1, 3]
