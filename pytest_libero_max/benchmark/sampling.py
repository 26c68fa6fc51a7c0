"""Parts of a manifest: small samples with its composition, and shards of about the same cost."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import OptionError, counted

Cell = tuple[str, int, str, str]
"""Event, variant, source, suite."""


def stratified(cases: Iterable[Case], limit: int) -> tuple[Case, ...]:
    """Return at most ``limit`` cases, spread as evenly as possible, in their original order.

    Cases are taken one by one, each from the cell of (event, variant, source, suite) that is behind most:
    first by its event, then event and variant, variant, source and suite. Within a cell the order is that
    of a hash of the case id, so a larger limit only adds cases, and outcomes play no part. Fewer cases than
    there are events are of as many families of events as possible.

    Raises:
        OptionError: ``limit`` is below 1.
    """
    cases = tuple(cases)
    if limit < 1:
        raise OptionError.seen("limit", limit, ", but must be at least 1.")
    if limit >= len(cases):
        return cases
    events = len({case.event.name for case in cases})
    picks = _picks(cases, max(limit, events))
    if limit < events:  # each of these is of another event: the first one of each family comes first
        seen: Counter[str] = Counter()
        turns = {}
        for case in picks:
            turns[case.case_id] = seen[case.event.family_code]
            seen[case.event.family_code] += 1
        picks.sort(key=lambda case: turns[case.case_id])
    chosen = {case.case_id for case in picks[:limit]}
    return tuple(case for case in cases if case.case_id in chosen)


def _picks(cases: Iterable[Case], limit: int) -> list[Case]:
    """Return the first cases in the order in which they are taken."""
    waiting: dict[Cell, list[Case]] = {}
    for case in sorted(cases, key=lambda case: _rank(case.case_id), reverse=True):
        waiting.setdefault(_cell(case), []).append(case)
    taken: Counter[object] = Counter()
    picks: list[Case] = []
    while len(picks) < limit:
        cell = min(waiting, key=lambda cell: _priority(cell, taken))
        picks.append(waiting[cell].pop())
        taken.update(_shares(cell))
        if not waiting[cell]:
            del waiting[cell]
    return picks


def in_share(cases: Iterable[Case], share: float, purpose: str) -> frozenset[str]:
    """Return ids of about this share of the cases, by a hash of purpose and id: the same in every selection.

    Args:
        share: 0 to 1; at 1 all of them.
        purpose: Name of the draw; draws of other names are independent.
    """
    hashed = {
        case.case_id: hashlib.sha256(f"libero-max-{purpose}|{case.case_id}".encode()).digest()
        for case in cases
    }
    return frozenset(name for name, it in hashed.items() if int.from_bytes(it[:8], "big") < share * 2**64)


def _cell(case: Case) -> Cell:
    return case.event.name, case.event.variant, case.source, case.suite


def _shares(cell: Cell) -> tuple[object, ...]:
    """Return the quotas that one case of the cell counts towards, the most important first."""
    event, variant, source, suite = cell
    return event, (event, variant), variant, source, suite, cell


def _priority(cell: Cell, taken: Counter[object]) -> tuple[object, ...]:
    return (*(taken[share] for share in _shares(cell)), _rank("|".join(map(str, cell))))


def _rank(text: str) -> str:
    return hashlib.sha256(f"libero-max-subset|{text}".encode()).hexdigest()


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
