"""Which configurations the benchmark uses. Decided from descriptions and from what failed the preflight.

Every LIBERO-Plus cell (category, event, parameter variant) gets 50 tasks that no other cell of its category
uses, difficulties as even as can be; every LIBERO-PRO cell gets 15 pairs of task and initial state, tasks
used equally often. A case that has passed keeps its place; one that fails is replaced in its own cell.
Outcomes of policies cannot get here: nothing is imported that knows them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from pytest_libero_max.cases import EVENTS, Case
from pytest_libero_max.construction.catalogue.counts import CATEGORIES as PLUS_CATEGORIES
from pytest_libero_max.construction.catalogue.pro import CATEGORIES as PRO_CATEGORIES
from pytest_libero_max.construction.catalogue.variant import Variant
from pytest_libero_max.construction.configurations import PRO_STATES, Cell, Configuration, hosts
from pytest_libero_max.construction.identity import seed_of
from pytest_libero_max.construction.matching import Shortage, fill
from pytest_libero_max.errors import ManifestError

PLUS_PER_CELL, PRO_PER_CELL = 50, 15
LEVELS = 5
SAMPLER = "libero-max-embedded-v1.0"
"""Name of the random draws that decide between equally good selections."""

Chosen = Mapping[str, tuple[Cell, Configuration]]
"""Cell and configuration by case id."""

Examine = Callable[[Sequence[Case]], Collection[str]]
"""Looks at cases, and returns the ids of those that fail."""


def cells_of(category: str) -> tuple[Cell, ...]:
    """The sixteen cells of a source category."""
    return tuple(Cell(category, event, draw) for event, draw in product(EVENTS, (0, 1)))


def select(examine: Examine) -> tuple[Case, ...]:
    """Choose all 8,000 cases, and replace those that fail until none does.

    Args:
        examine: Asked in rounds, never twice about the same case. The selection is a function of its answers.

    Returns:
        The cases, sorted by id.

    Raises:
        ManifestError: A cell cannot be filled; names it.
    """
    chosen: dict[str, tuple[Cell, Configuration]] = {}
    cases: dict[str, Case] = {}
    failed: set[str] = set()
    while proposed := propose(chosen, failed):
        new = {name: configuration.case(cell) for name, (cell, configuration) in proposed.items()}
        failed_now = set(examine(list(new.values())))
        failed |= failed_now
        chosen |= {name: place for name, place in proposed.items() if name not in failed_now}
        cases |= {name: case for name, case in new.items() if name not in failed_now}
    return tuple(cases[name] for name in sorted(cases))


def propose(chosen: Chosen, failed: Collection[str]) -> dict[str, tuple[Cell, Configuration]]:
    """What fills the places that are free.

    Args:
        chosen: What stays.
        failed: Ids of cases that must not be used.

    Raises:
        ManifestError: A cell cannot be filled.
    """
    by_category: dict[str, list[tuple[Cell, Configuration]]] = {}
    for cell, configuration in chosen.values():
        by_category.setdefault(cell.category, []).append((cell, configuration))
    proposed = [
        place
        for category in PLUS_CATEGORIES
        for place in _fill_plus(category, by_category.get(category, []), failed)
    ]
    proposed += [
        place
        for category in PRO_CATEGORIES
        for place in _fill_pro(category, by_category.get(category, []), failed)
    ]
    return {configuration.case_id(cell): (cell, configuration) for cell, configuration in proposed}


def _fill_plus(
    category: str, chosen: Sequence[tuple[Cell, Configuration]], failed: Collection[str]
) -> Iterator[tuple[Cell, Configuration]]:
    cells = cells_of(category)
    filled = Counter(cell for cell, _ in chosen)
    need = np.array([PLUS_PER_CELL - filled[cell] for cell in cells])
    if not need.any():
        return
    used = {(configuration.variant.suite, configuration.variant.index) for _, configuration in chosen}
    free = [
        (Configuration(variant, 0), events)
        for variant, events in hosts("plus", category)
        if (variant.suite, variant.index) not in used
    ]
    fits = np.array(
        [[cell.event in events and one.case_id(cell) not in failed for cell in cells] for one, events in free]
    )
    cost = np.array([[_rank(cell, one) for cell in cells] for one, _ in free])
    levels = np.array([_level(one.variant) for one, _ in free])
    kept = np.bincount([_level(one.variant) for _, one in chosen], minlength=LEVELS)
    try:
        found = fill(fits, need, levels, kept, cost)
    except Shortage as shortage:
        names = "; ".join(str(cells[number]) for number in shortage.cells)
        raise ManifestError(
            f"The cells ({names}) need {shortage.needed} more tasks between them, but only {shortage.there} "
            "can still host any of these events: the others lack what they need, are in use or failed the "
            "preflight. Fewer cases a cell, or scenes in which more of them pass, would help."
        ) from shortage
    for (one, _), number in zip(free, found, strict=True):
        if number >= 0:
            yield cells[number], one


def _level(variant: Variant) -> int:
    assert variant.difficulty is not None  # hosts() leaves the others out
    return variant.difficulty - 1


def _fill_pro(
    category: str, chosen: Sequence[tuple[Cell, Configuration]], failed: Collection[str]
) -> Iterator[tuple[Cell, Configuration]]:
    filled = Counter(cell for cell, _ in chosen)
    usage = Counter((one.variant.suite, one.variant.index) for _, one in chosen)
    taken = {one.case_id(cell) for cell, one in chosen}
    for cell in cells_of(category):
        free = [
            Configuration(variant, init)
            for variant, events in hosts("pro", category)
            if cell.event in events
            for init in range(PRO_STATES)
        ]
        free = [one for one in free if one.case_id(cell) not in failed and one.case_id(cell) not in taken]
        here = Counter((one.variant.suite, one.variant.index) for at, one in chosen if at == cell)
        needed = PRO_PER_CELL - filled[cell]
        if len(free) < needed:
            raise ManifestError(
                f"The cell ({cell}) needs {needed} more configurations, but only {len(free)} are left: the "
                "others lack what the event needs, are in use or failed the preflight. Fewer cases a cell, "
                "or scenes in which more of them pass, would help."
            )
        ranks = {one: _rank(cell, one) for one in free}
        for _ in range(needed):
            best = min(free, key=lambda one: (*_use(one, here, usage), ranks[one]))
            free.remove(best)
            here[best.variant.suite, best.variant.index] += 1
            usage[best.variant.suite, best.variant.index] += 1
            yield cell, best


def _use(
    one: Configuration, here: Counter[tuple[str, int]], usage: Counter[tuple[str, int]]
) -> tuple[int, int]:
    """How often the task is used: in the cell, then in the category."""
    task = one.variant.suite, one.variant.index
    return here[task], usage[task]


def _rank(cell: Cell, one: Configuration) -> int:
    return seed_of(SAMPLER, *cell, one.variant.suite, one.variant.index, one.init)
