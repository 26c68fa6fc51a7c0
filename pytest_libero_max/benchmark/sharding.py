"""Parts of a case set of about the same cost."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import OptionError, counted


def shard(cases: Sequence[Case], index: int, count: int) -> tuple[Case, ...]:
    """Return the cases of one of several parts. All parts together are all cases, each of them once.

    A part is a block of cases in the order of their item ids. So the cases of a scene, which is expensive to
    build, stay together, with all events and variants that are played in it. Blocks are cut where the budgets
    of the cases, the most steps an arm may take, add up to the same; the suites' budgets differ by more than
    twice.

    Args:
        index: Number of the part, from 1.

    Raises:
        OptionError: A part would be empty, this one or another, so that no part is played in vain.
    """
    ordered = sorted(cases, key=lambda case: case.item_id)
    before = [0, *accumulate(case.budget for case in ordered)]
    middles = [2 * start + case.budget for start, case in zip(before, ordered, strict=False)]
    parts = [middle * count // (2 * before[-1]) for middle in middles]
    if len(set(parts)) < count:
        raise OptionError(
            f"{counted(len(ordered), 'pair')} cannot be {counted(count, 'shard')} of about the same cost "
            "with a pair each. Make fewer."
        )
    return tuple(case for part, case in zip(parts, ordered, strict=True) if part == index - 1)
