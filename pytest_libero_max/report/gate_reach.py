"""Gates that no outcome can meet, or none can fail: refused before anything is played."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gate_arguments import refused
from pytest_libero_max.report.gate_bounds import BOUNDED
from pytest_libero_max.report.gate_quantities import COUNTS, is_of_pairs
from pytest_libero_max.report.gates import Gate, always_or_never, decided_value, versus_value
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE, SuccessContrast
from pytest_libero_max.stats.comparison import contrasts
from pytest_libero_max.stats.paired import Pairs, measure

_CURE = "Gate more pairs, a wider limit, or the estimate; libero-max plan gates says what can be met."
_NARROWER = "It would pass whatever the policy does: give a narrower limit, or gate dynamic_sr."
_MANY = 10_000
"""More stale actions than an episode has steps."""

EXACT = (*BOUNDED, "stale_mean", "stale_median")
"""Quantities whose smallest and largest values are among those of :func:`extremes`."""


def require_reachable(gate: Gate, chosen: Sequence[PlannedPair]) -> None:
    """Refuse a limit for a quantity of the run that none of its extreme outcomes meets, or all of them.

    Args:
        gate: A gate that names no other run. One on what is chosen, on what probes measure, or on a section
            of the report passes.
    """
    if not is_of_pairs(gate.name):
        return
    pairs = gate.of_scope(chosen)
    if not pairs:
        return
    if gate.name in COUNTS:
        values: list[float] = [0, len(pairs)]
    else:
        rows = map(measure, extremes(pairs))
        values = [value for row in rows if (value := decided_value(gate, row)) is not None]
    exact = gate.name in (*COUNTS, *EXACT)
    _require_open(gate, values, counted(len(pairs), "pair"), exact=exact)


def _require_open(gate: Gate, values: Sequence[float], pairs: str, there: str = "", *, exact: bool) -> None:
    """Refuse a gate that no value from the smallest to the largest meets, or every one.

    Args:
        values: Values at the extremes; none meets the gate where there are none.
        there: What is known of the other run, a clause.
        exact: True if no outcome has a value outside these.
    """
    always, never = always_or_never(gate, min(values), max(values)) if values else (False, True)
    if never and (exact or gate.operator not in ("==", "!=")):
        raise refused(gate.text, f" can never hold: no outcome of its {pairs} can meet it{there}. {_CURE}")
    if exact and always:
        raise refused(
            gate.text, f" can never fail: every outcome of its {pairs} meets it{there}. {_NARROWER}"
        )


def require_reachable_vs(gate: Gate, earlier: Sequence[bool]) -> None:
    """Refuse a limit for a difference from another run that no outcome of this one meets, or every one."""
    cases, succeeded = len(earlier), sum(earlier)
    if not cases:
        return
    extremes_there = [
        versus_value(gate, _contrast(succeeded, losses, gains, cases))
        for losses in (0, succeeded)
        for gains in (0, cases - succeeded)
    ]
    values = [value for value in extremes_there if value is not None]
    there = f", of which Dynamic succeeded in {succeeded} of the {cases} there"
    _require_open(gate, values, counted(cases, "pair"), there, exact=True)


def _contrast(earlier: int, losses: int, gains: int, cases: int) -> SuccessContrast:
    """Return the contrast with another run, of whose successes so many are lost, and of the others gained."""
    there = np.arange(cases) < earlier
    here = there.copy()
    here[:losses] = False
    here[earlier : earlier + gains] = True
    return contrasts({"there": there, "here": here})[0]


def extremes(planned: Sequence[PlannedPair]) -> Iterator[Pairs]:
    """Outcomes at the ends of what can be: all or few Base successes, all or none kept, a change a task.

    Base succeeds in as many pairs at least as a gate on a change needs. Then, with one outcome: many stale
    actions, no query after the event, and no event.
    """
    n, tasks = len(planned), [pair.task for pair in planned]
    few = np.arange(n) < np.ceil(FLOOR_BASE_RATE * n)
    every, none = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    first = np.zeros(n, dtype=np.bool_)
    first[np.unique(np.asarray(tasks), return_index=True)[1]] = True
    outcomes: list[tuple[NDArray[np.bool_], NDArray[np.bool_]]] = [
        (every, every),
        (few, every),
        (every, none),
        (few, few),
        (few, none),
        (every, ~first),
        (~first, every),
        (none, every),
        (none, none),
    ]
    stale = np.zeros(n, dtype=np.int64)
    exposures = [(every, every, stale)] * len(outcomes)
    outcomes += [(every, every)] * 3
    exposures += [(every, every, stale + _MANY), (every, none, stale), (none, none, stale - 1)]
    for (base, dynamic), (triggered, responded, actions) in zip(outcomes, exposures, strict=True):
        yield Pairs.of(
            base=base,
            dynamic=dynamic,
            triggered=triggered,
            responded=responded,
            stale=actions,
            source=[pair.source for pair in planned],
            task=tasks,
        )
