"""Gates that no outcome can meet: found before anything is played."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.gates import (
    BEYOND_SHAM,
    COUNTS,
    EQUIVALENCE_CONFIDENCE,
    EQUIVALENT,
    WHOLE_TRACK,
    Gate,
    meets,
    value_in,
)
from pytest_libero_max.report.measured import result_of
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.breakdown import FLOOR_BASE_RATE
from pytest_libero_max.stats.paired import Pairs, measure
from pytest_libero_max.stats.paired_difference import paired_difference

_CURE = "Gate more pairs, a wider limit, or the estimate; libero-max power --gate says what can be met."
_MANY = 10_000
"""More stale actions than an episode has steps."""


def require_reachable(gate: Gate, chosen: Sequence[PlannedPair]) -> None:
    """Refuse a limit for a quantity of the run that none of its extreme outcomes meets.

    Args:
        gate: A gate that names no other run. One that asks for equality, for a count of pairs, or for the
            sham event, which a share of the pairs plays, passes.
        chosen: The pairs of the run.

    Raises:
        OptionError: No outcome of the pairs meets it.
    """
    if gate.name in (*COUNTS, WHOLE_TRACK, BEYOND_SHAM) or gate.operator in ("==", "!="):
        return
    pairs = [pair for pair in chosen if gate.scope is None or _label(gate.scope[0], pair) == gate.scope[1]]
    if pairs and not any(_met(gate, outcome) for outcome in _extremes(pairs)):
        raise OptionError.seen(
            "gate", gate.text, f" can never hold: no outcome of its {len(pairs)} pairs can meet it. {_CURE}"
        )


def require_reachable_vs(gate: Gate, earlier: Sequence[bool]) -> None:
    """Refuse a limit for a difference from another run that no outcome of this one meets.

    Args:
        gate: A gate against another run.
        earlier: Dynamic success of the other run on the cases of this one.

    Raises:
        OptionError: No outcome of the cases meets it.
    """
    cases, succeeded = len(earlier), sum(earlier)
    if gate.name == EQUIVALENT:
        interval = paired_difference(0, 0, cases, EQUIVALENCE_CONFIDENCE)
        reachable = interval is None or meets(gate, max(-interval.lower, interval.upper))
    elif gate.name == "dynamic_sr_vs" and gate.operator not in ("==", "!="):
        best, worst = paired_difference(0, cases - succeeded, cases), paired_difference(succeeded, 0, cases)
        if best is None or worst is None:
            return
        if gate.end is None:
            reachable = meets(gate, 1 - succeeded / cases) or meets(gate, -succeeded / cases)
        else:
            reachable = meets(gate, getattr(best, gate.end)) or meets(gate, getattr(worst, gate.end))
    else:
        return
    if not reachable:
        raise OptionError.seen(
            "gate",
            gate.text,
            f" can never hold: no outcome of its {cases} pairs can meet it, of which Dynamic succeeded in "
            f"{succeeded} of the {cases} there. {_CURE}",
        )


def _label(dimension: str, pair: PlannedPair) -> str:
    return DIMENSIONS[dimension].label(pair)


def _met(gate: Gate, pairs: Pairs) -> bool:
    value = value_in(gate, result_of(measure(pairs), len(pairs)))
    return value is not None and meets(gate, value)


def _extremes(planned: Sequence[PlannedPair]) -> Iterator[Pairs]:
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
