"""How long it took: restricted mean time to success, recovery after the event, way and jerk of the hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from statistics import fmean
from typing import ClassVar

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import STAGES
from pytest_libero_max.report.measures import Measured, Rows, in_both_arms
from pytest_libero_max.report.report_document import SuccessCurves
from pytest_libero_max.report.sections import PlayedPairs, ReportSection
from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.intervals import LEAST_DIFFERENT, mean_difference_interval

PROBE = "motion"
TITLE = "How long it took"
NOTE = (
    "An episode without success counts with the steps that it may take. Times of Base begin at the step of "
    "the event in Dynamic. Medians are over the pairs that have the quantity. A stage is the first touch, "
    "grasp, lift, arrival above the destination or satisfaction of a fact of the goal, or success; a stage "
    "reached before the event does not count again."
)

_ARMS = (BASE, DYNAMIC)
_MILESTONES = ("touch_step", "grasp_step", "lift_step", "above_step", "satisfied_step")

_MEAN = "Restricted mean time to success"
_MEANS = in_both_arms("timing.mean", _MEAN, "steps")
_DIFFERENCE = Measured("timing.mean.change", f"{_MEAN}, Dynamic - Base", "more steps")
_CLUSTERED = Measured("timing.mean.change_clustered", f"{_DIFFERENCE.title}, for other tasks", "more steps")


def _of_stage(key: str, title: str) -> tuple[Measured, Measured, Measured]:
    both = Measured(f"{key}.change", f"{title}, Dynamic - Base where both have it", "more steps")
    return (*in_both_arms(key, title, "steps"), both)


_SUCCESS = _of_stage("timing.success", "Median from event to success")
_NEXT_STAGE = _of_stage("timing.next_stage", "Median from event to the next stage")

_WAYS = (
    Measured("timing.way.before", "Median way of the hand to the event, the same in both arms", "m", PROBE),
    *in_both_arms("timing.way", "Median way after the event", "m", PROBE),
    Measured(
        "timing.way.ratio", "Median way after the event, Dynamic / Base where both succeed", "times", PROBE
    ),
)
_JERKS = (
    Measured("timing.jerk.before", "Median jerk to the event, the same in both arms", "m/s^3", PROBE),
    *in_both_arms("timing.jerk", "Median jerk after the event", "m/s^3", PROBE),
    Measured("timing.jerk.ratio", "Median jerk after the event, Dynamic / Base", "times", PROBE),
)

Measure = Callable[[PairRecord, str], float | None]


class Timing(ReportSection):
    """Times to success, and way and jerk of the hand."""

    name = "timing"
    quantities = (*_MEANS, _DIFFERENCE, _CLUSTERED, *_SUCCESS, *_NEXT_STAGE, *_WAYS, *_JERKS)
    notes: ClassVar[Mapping[str, str]] = {TITLE: NOTE}
    interval_notes: ClassVar[Mapping[str, str]] = {TITLE: "A range in brackets is a 95% interval."}

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        records = played.records
        if not records:
            return {}
        base, dynamic = ([_restricted(record, arm) for record in records] for arm in _ARMS)
        rows: Rows = {"Pairs played": len(records)}
        for quantity, steps in zip(_MEANS, (base, dynamic), strict=True):
            rows |= quantity.row(fmean(steps))
        changes = [after - before for before, after in zip(base, dynamic, strict=True)]
        rows |= _mean_difference(changes, played)
        fired = [record for record in records if record.triggered]
        rows["Pairs with an event"] = len(fired)
        for (*in_arms, both), measure in ((_SUCCESS, _to_success), (_NEXT_STAGE, _to_next_stage)):
            rows |= _in_arms(in_arms, fired, measure)
            rows |= both.median([_less(record, measure) for record in fired])
        return {TITLE: rows | _motion(fired)}


def _mean_difference(changes: Sequence[int], played: PlayedPairs) -> Rows:
    if not played.with_intervals:
        return _DIFFERENCE.row(fmean(changes))
    interval = mean_difference_interval(changes)
    lack = f"{sum(change != 0 for change in changes)} of {LEAST_DIFFERENT} needed pairs differ"
    rows = _DIFFERENCE.row(fmean(changes), interval, lack="" if interval else lack)
    by_task = task_interval(changes, played.tasks, interval, bounds=(-math.inf, math.inf))
    if by_task.interval is not None:
        rows |= _CLUSTERED.row(fmean(changes), by_task.interval)
        rows["Tasks"] = by_task.tasks
    return rows


def _in_arms(quantities: Sequence[Measured], records: Sequence[PairRecord], measure: Measure) -> Rows:
    rows: Rows = {}
    for quantity, arm in zip(quantities, _ARMS, strict=True):
        rows |= quantity.median([measure(record, arm) for record in records])
    return rows


def _less(record: PairRecord, measure: Measure) -> float | None:
    base, dynamic = (measure(record, arm) for arm in _ARMS)
    return None if base is None or dynamic is None else dynamic - base


def success_curves(records: Sequence[PairRecord]) -> SuccessCurves | None:
    """Return the numbers of pairs not yet completed by step; None without pairs."""
    if not records:
        return None
    ends = {
        arm: [arm_of.steps for record in records if (arm_of := record.arms[arm]).success] for arm in _ARMS
    }
    steps = sorted({0, *ends[BASE], *ends[DYNAMIC], max(record.max_steps for record in records)})
    base, dynamic = (
        [len(records) - sum(end <= step for end in ends[arm]) for step in steps] for arm in _ARMS
    )
    return SuccessCurves(pairs=len(records), steps=steps, base=base, dynamic=dynamic)


def _restricted(record: PairRecord, arm: str) -> int:
    """Return the steps to success; those that the episode may take where there was none."""
    played = record.arms[arm]
    return played.steps if played.success else record.max_steps


def _event(record: PairRecord) -> int:
    return record.trigger_step or 0


def _to_success(record: PairRecord, arm: str) -> int | None:
    """Return the steps from the event in Dynamic to success; None without success."""
    played = record.arms[arm]
    return played.steps - _event(record) if played.success else None


def _to_next_stage(record: PairRecord, arm: str) -> int | None:
    """Return the steps from the event in Dynamic to the next stage that is reached for the first time.

    A stage is the first touch, grasp, lift, arrival above the destination or satisfaction of a fact of the
    goal, or success.
    """
    played = record.arms[arm]
    stages = played.probes.get(STAGES)
    if stages is None:
        return None
    steps = [step for name in _MILESTONES for step in stages[name] if step is not None]
    if played.success:
        steps.append(played.steps)
    return min((step - _event(record) for step in steps if step > _event(record)), default=None)


def _motion(fired: Sequence[PairRecord]) -> Rows:
    watched = [record for record in fired if all(PROBE in record.arms[arm].probes for arm in _ARMS)]
    if not watched:
        return {}
    rows: Rows = {"Pairs whose motion was watched": len(watched)}
    for (before, *after), measure in ((_WAYS, _way), (_JERKS, _jerk)):
        to_event = [measure(record, BASE, before=True) for record in watched]
        rows |= before.median(to_event)
        rows |= _in_arms(after[:2], watched, measure)
        rows |= after[2].median([_ratio(record, measure) for record in watched])
    return rows


def _ratio(record: PairRecord, measure: Measure) -> float | None:
    if measure is _way and not (record.base_success and record.dynamic_success):
        return None
    base, dynamic = (measure(record, arm) for arm in _ARMS)
    return None if not base or dynamic is None else dynamic / base


def _way(record: PairRecord, arm: str, *, before: bool = False) -> float:
    """Return the way of the hand after the event, or before it, m."""
    ways, event = record.arms[arm].probes[PROBE]["step_m"], _event(record)
    return math.fsum(ways[:event] if before else ways[event:])


def _jerk(record: PairRecord, arm: str, *, before: bool = False) -> float | None:
    """Return the root mean square of the jerk whose four positions are all after the event, or before it.

    None where there are not four such positions.
    """
    jerks, event = record.arms[arm].probes[PROBE]["step_jerk_m_s3"], _event(record)
    part = jerks[: max(0, event - 2)] if before else jerks[event:]
    return math.sqrt(math.fsum(one * one for one in part) / len(part)) if part else None
