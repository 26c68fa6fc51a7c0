"""Selection of the benchmark's configurations, from descriptions and from failures of the preflight.

Every LIBERO-Plus cell (category, event, parameter variant) gets 50 tasks that no other cell of its category
uses, difficulties as even as can be; every LIBERO-PRO cell gets 15 pairs of task and initial state, tasks
used equally often. A case that has passed keeps its place; one that fails is replaced in its own cell. Where
that cost evenness, because tasks of a difficulty are scarce, as few passing cases as possible make room.
Outcomes of policies cannot get here: no module that knows them is imported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.identity import seed_of
from pytest_libero_max.errors import ManifestError, counted
from pytest_libero_max.events.configurations import OWN, PRO_STATES, Cell, Configuration
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.makers.construction.configurations import hosts
from pytest_libero_max.makers.construction.matching import Shortage, fill
from pytest_libero_max.substrates.contract import Catalogue
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES, PRO_CATEGORIES

PLUS_PER_CELL, PRO_PER_CELL = 50, 15
LEVELS = 5
SAMPLER = "libero-max-embedded-v1.0"
"""Name of the random draws that decide between equally good selections."""


class Pool(NamedTuple):
    """The pool that cases are selected from."""

    catalogue: Catalogue = OWN
    sampler: str = SAMPLER
    """Name of the random draws that decide between equally good selections."""


OWN_POOL = Pool()

Places = dict[str, tuple[Cell, Configuration]]
"""Cell and configuration by case id."""

_MOVE = 2**42
"""Cost of a case that is not kept: more than all ranks of a category together, so that the fewest move."""

Place = TypeVar("Place")

Examine = Callable[[Sequence[Case]], Collection[str]]
"""Examines cases, and returns the ids of those that fail."""


def cells_of(category: str) -> tuple[Cell, ...]:
    """Return the sixteen cells of a source category."""
    return tuple(Cell(category, event, draw) for event, draw in product(BENCHMARK_EVENTS, (0, 1)))


def choose(
    examine: Examine,
    propose: Callable[[Collection[str], Collection[str]], Mapping[str, Place]],
    case_of: Callable[[Place], Case],
) -> tuple[Case, ...]:
    """Propose cases, examine the new ones, and propose again without those that fail until none does.

    Args:
        examine: Called in rounds, never twice about the same case. The choice is a function of its answers.
        propose: Returns a place for each case by its id, given the ids that passed and those that failed.
        case_of: Makes the case of a place.

    Returns:
        The cases, sorted by id.
    """
    passed: dict[str, Case] = {}
    failed: set[str] = set()
    while True:
        places = propose(passed.keys(), failed)
        new = [case_of(place) for name, place in places.items() if name not in passed]
        if not new:
            return tuple(passed[name] for name in sorted(places))
        failed_now = set(examine(new))
        failed |= failed_now
        passed |= {case.case_id: case for case in new if case.case_id not in failed_now}


def select(examine: Examine, pool: Pool = OWN_POOL) -> tuple[Case, ...]:
    """Choose all 8,000 cases; see :func:`choose`.

    Raises:
        ManifestError: A cell cannot be filled; names it.
    """
    places: Places = {}

    def fill_cells(passed: Collection[str], failed: Collection[str]) -> Places:
        nonlocal places
        places = propose({name: place for name, place in places.items() if name in passed}, failed, pool)
        return places

    return choose(examine, fill_cells, lambda place: place[1].case(place[0]))


def propose(kept: Places, failed: Collection[str], pool: Pool = OWN_POOL) -> Places:
    """Fill every cell.

    Args:
        kept: Cases with a place already. A LIBERO-Plus case gives it up only where difficulties could not be
            as even otherwise.
        failed: Ids of cases that must not be used.

    Raises:
        ManifestError: A cell cannot be filled.
    """
    by_category: dict[str, list[tuple[Cell, Configuration]]] = {}
    for cell, configuration in kept.values():
        by_category.setdefault(cell.category, []).append((cell, configuration))
    places: list[tuple[Cell, Configuration]] = []
    for category in PLUS_CATEGORIES:
        places += _fill_plus(category, by_category.get(category, []), failed, pool)
    for category in PRO_CATEGORIES:
        places += _fill_pro(category, by_category.get(category, []), failed, pool)
    return {configuration.case_id(cell): (cell, configuration) for cell, configuration in places}


def _fill_plus(
    category: str, kept: Sequence[tuple[Cell, Configuration]], failed: Collection[str], pool: Pool
) -> Iterable[tuple[Cell, Configuration]]:
    cells = cells_of(category)
    if len(kept) == PLUS_PER_CELL * len(cells):
        return kept
    tasks = _plus_tasks(category, pool)
    in_place = {configuration.case_id(cell) for cell, configuration in kept}
    fits = tasks.hosts & np.array([[name not in failed for name in names] for names in tasks.ids])
    cost = np.where([[name in in_place for name in names] for names in tasks.ids], 0, _MOVE + tasks.ranks)
    try:
        choice = fill(fits, np.full(len(cells), PLUS_PER_CELL), tasks.levels, cost)
    except Shortage as shortage:
        names = "; ".join(str(cells[number]) for number in shortage.cells)
        raise ManifestError(
            f"The cells ({names}) need {counted(shortage.needed, 'task')} between them, but only "
            f"{shortage.there} can "
            "host any of these events: the others lack what they need or failed the preflight. Fewer cases "
            "a cell, or scenes in which more of them pass, would help."
        ) from shortage
    return [
        (cells[number], configuration)
        for configuration, number in zip(tasks.configurations, choice, strict=True)
        if number >= 0
    ]


@dataclass(frozen=True)
class _PlusTasks:
    """The tasks of a LIBERO-Plus category, and what never changes about them: n tasks by 16 cells."""

    configurations: Sequence[Configuration]
    """The tasks."""
    ids: Sequence[Sequence[str]]
    """Ids of the case of a task in a cell."""
    hosts: NDArray[np.bool_]
    """True if its scene can host the cell's event."""
    ranks: NDArray[np.int64]
    """Order of preference among them."""
    levels: NDArray[np.int64]
    """(n,) difficulties, from 0."""


@cache
def _plus_tasks(category: str, pool: Pool) -> _PlusTasks:
    cells = cells_of(category)
    hosting = hosts("plus", category, pool.catalogue)
    tasks = [(Configuration(variation, 0, pool.catalogue), events) for variation, events in hosting]
    return _PlusTasks(
        [configuration for configuration, _ in tasks],
        [[configuration.case_id(cell) for cell in cells] for configuration, _ in tasks],
        np.array([[cell.event in events for cell in cells] for _, events in tasks]),
        np.array([[_rank(pool, cell, configuration) for cell in cells] for configuration, _ in tasks]),
        np.array([_level(configuration.variation) for configuration, _ in tasks]),
    )


def _level(variation: Variation) -> int:
    assert variation.difficulty is not None  # hosts() leaves the others out
    return variation.difficulty - 1


def _fill_pro(
    category: str, kept: Sequence[tuple[Cell, Configuration]], failed: Collection[str], pool: Pool
) -> Iterable[tuple[Cell, Configuration]]:
    usage = Counter(
        (configuration.variation.suite, configuration.variation.index) for _, configuration in kept
    )
    taken = {configuration.case_id(cell) for cell, configuration in kept}
    for cell in cells_of(category):
        here = [place for place in kept if place[0] == cell]
        yield from here
        needed = PRO_PER_CELL - len(here)
        if not needed:
            continue
        free = [
            configuration
            for name, configuration in _pro_cases(cell, pool.catalogue).items()
            if name not in failed and name not in taken
        ]
        if len(free) < needed:
            raise ManifestError(
                f"The cell ({cell}) needs {needed} more configurations, but only {len(free)} are left: the "
                "others lack what the event needs, are in use or failed the preflight. Fewer cases a cell, "
                "or scenes in which more of them pass, would help."
            )
        used_here = Counter(
            (configuration.variation.suite, configuration.variation.index) for _, configuration in here
        )
        ranks = {configuration: _rank(pool, cell, configuration) for configuration in free}
        for _ in range(needed):
            best = min(
                free, key=lambda configuration: (*_use(configuration, used_here, usage), ranks[configuration])
            )
            free.remove(best)
            used_here[best.variation.suite, best.variation.index] += 1
            usage[best.variation.suite, best.variation.index] += 1
            yield cell, best


@cache
def _pro_cases(cell: Cell, catalogue: Catalogue) -> dict[str, Configuration]:
    """Return configurations that can host a LIBERO-PRO cell's event, by the id of the case made of each."""
    configurations = (
        Configuration(variation, init, catalogue)
        for variation, events in hosts("pro", cell.category, catalogue)
        if cell.event in events
        for init in range(PRO_STATES)
    )
    return {configuration.case_id(cell): configuration for configuration in configurations}


def _use(
    configuration: Configuration, here: Counter[tuple[str, int]], usage: Counter[tuple[str, int]]
) -> tuple[int, int]:
    task = configuration.variation.suite, configuration.variation.index
    return here[task], usage[task]


def _rank(pool: Pool, cell: Cell, configuration: Configuration) -> int:
    return seed_of(
        pool.sampler, *cell, configuration.variation.suite, configuration.variation.index, configuration.init
    )
