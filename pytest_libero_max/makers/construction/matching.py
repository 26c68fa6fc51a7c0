"""Filling cells with different tasks, as evenly over levels as can be: an integral flow, solved by SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import counted

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


class Shortage(Exception):
    """Some cells together need more tasks than there are for them: a smallest proof, by Hall's theorem."""

    def __init__(self, cells: tuple[int, ...], needed: int, there: int) -> None:
        super().__init__(f"cells {cells} need {counted(needed, 'task')}, and there are {there}")
        self.cells, self.needed, self.there = cells, needed, there


def fill(fits: Flags, need: Integers, levels: Integers, cost: Integers) -> Integers:
    """Give every cell as many tasks as it needs, no task to two cells, with the least total cost.

    Among all fillings those count whose levels are most even: no other one has a smaller sum of squares of
    the numbers of tasks by level. Costs decide between these. With costs that are drawn at random the
    solution is unique, and so does not depend on the solver.

    Args:
        fits: (tasks, cells): True where a task can be used in a cell.
        need: (cells,): number of tasks each needs.
        levels: (tasks,): the level of each task, from 0.
        cost: (tasks, cells), at least 0, all of them together below 2 to the power of 53.

    Returns:
        (tasks,): the cell in which each task is used, -1 for none.

    Raises:
        Shortage: There is no filling.
    """
    from scipy.optimize import linear_sum_assignment

    taken = most_even(fits, need, levels)
    slots = np.repeat(np.arange(len(need)), need)
    price = np.where(fits, cost, np.inf)[:, slots].astype(float)
    # Tasks that are left over go to places of their level, as many as are not to be used.
    spare = np.bincount(levels) - taken
    places = np.repeat(np.arange(len(taken)), spare)
    rest = np.where(levels[:, None] == places, 0.0, np.inf)
    rows, columns = linear_sum_assignment(np.hstack([price, rest]))
    choice = np.full(len(fits), -1)
    used = columns < len(slots)
    choice[rows[used]] = slots[columns[used]]
    return choice


def most_even(fits: Flags, need: Integers, levels: Integers) -> Integers:
    """Return the number of tasks of each level in the most even filling; arguments as in :func:`fill`.

    The numbers that fillings can take from the levels form an integral polymatroid, on which raising
    the lowest level that can still be raised leads to the smallest sum of squares (Federgruen and
    Groenevelt, Operations Research 34, 1986). Where plain levelling by supply can be had, it is that.

    Raises:
        Shortage: There is no filling.
    """
    total = int(need.sum())
    supply = np.bincount(levels[fits.any(axis=1)], minlength=int(levels.max(initial=0)) + 1)
    if supply.sum() >= total:
        best = levelled(supply, total)
        if _flow(fits, need, levels, best) == total:
            return best
    if _flow(fits, need, levels, supply) < total:
        raise _shortage(fits, need)
    taken, open_levels = np.zeros_like(supply), set(range(len(supply)))
    while taken.sum() < total:
        lowest = min(open_levels, key=lambda level: (taken[level], level))
        taken[lowest] += 1
        if _flow(fits, need, levels, taken) < taken.sum():
            taken[lowest] -= 1
            open_levels.remove(lowest)
    return taken


def levelled(supply: Integers, total: int) -> Integers:
    """Share ``total`` out over levels, always to the lowest that still has supply."""
    taken = np.zeros_like(supply)
    for _ in range(total):
        height = np.where(taken < supply, taken, np.iinfo(supply.dtype).max)
        taken[int(height.argmin())] += 1
    return taken


def _flow(fits: Flags, need: Integers, levels: Integers, limits: Integers) -> int:
    """Return the most tasks that can be used with at most ``limits`` of each level."""
    from scipy.sparse.csgraph import maximum_flow

    graph = _network(fits, need, levels, limits)
    return int(maximum_flow(graph, 0, graph.shape[0] - 1).flow_value)


def _network(fits: Flags, need: Integers, levels: Integers, limits: Integers) -> Any:
    """Source, levels, tasks, cells, sink, with the capacities between them."""
    from scipy.sparse import csr_array

    tasks, cells = fits.shape
    first_task, first_cell = 1 + len(limits), 1 + len(limits) + tasks
    task, cell = np.nonzero(fits)
    number = np.arange
    start = [np.zeros(len(limits)), 1 + levels, first_task + task, first_cell + number(cells)]
    end = [
        1 + number(len(limits)),
        first_task + number(tasks),
        first_cell + cell,
        np.full(cells, first_cell + cells),
    ]
    capacity = [limits, np.ones(tasks), np.ones(len(task)), need]
    size = first_cell + cells + 1
    joined = [np.concatenate(part).astype(np.int32) for part in (capacity, start, end)]
    return csr_array((joined[0], (joined[1], joined[2])), shape=(size, size))


def _shortage(fits: Flags, need: Integers) -> Shortage:
    """Return the cells on the sink's side of a smallest cut."""
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    one_level = np.zeros(len(fits), dtype=np.int64)
    graph = _network(fits, need, one_level, np.array([len(fits)]))
    sink = graph.shape[0] - 1
    left = graph - maximum_flow(graph, 0, sink).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    # What leads to the sink, against the arrows, is what more tasks would help.
    wanting = breadth_first_order(left.T.tocsr(), sink, return_predecessors=False)
    first_cell = 2 + len(fits)
    cells = np.sort(wanting[(wanting >= first_cell) & (wanting < sink)] - first_cell)
    there = int(fits[:, cells].any(axis=1).sum())
    return Shortage(tuple(int(cell) for cell in cells), int(need[cells].sum()), there)
