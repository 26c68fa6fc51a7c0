"""How long it took: restricted mean time to success, recovery after the event, way and jerk of the hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from statistics import fmean, median

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import STAGES
from pytest_libero_max.report.report_document import SuccessCurves
from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.durations import LEAST_DIFFERENT, mean_difference_interval, median_interval
from pytest_libero_max.stats.intervals import Interval

PROBE = "motion"
TITLE = "How long it took"
NOTE = (
    "An episode without success counts with the steps that it may take. Base is measured from the step of "
    "the event in Dynamic. Medians are over the pairs that have the quantity. Stages are the first touch, "
    "grasp, lift, arrival above the destination and satisfaction of a fact of the goal, and success; one "
    "that was reached before the event does not count again. A range in brackets is a 95% interval."
)

_ARMS = ((BASE, "Base"), (DYNAMIC, "Dynamic"))
_MILESTONES = ("touch_step", "grasp_step", "lift_step", "above_step", "satisfied_step")
_STEPS = "steps"

Rows = dict[str, str | int | float | bool | None]


def timing_section(
    records: Sequence[PairRecord], tasks: Sequence[str], *, with_intervals: bool = True
) -> dict[str, Rows]:
    """Return a section of the report on times; empty without pairs.

    Args:
        records: Played pairs.
        tasks: The task of each.
        with_intervals: False where a rule has ended the run: intervals are for a fixed number of pairs.
    """
    if not records:
        return {}
    base, dynamic = ([_restricted(record, arm) for record in records] for arm, _ in _ARMS)
    rows: Rows = {
        "Pairs played": len(records),
        "Restricted mean time to success, Base": f"{fmean(base):.1f} steps",
        "Restricted mean time to success, Dynamic": f"{fmean(dynamic):.1f} steps",
    }
    changes = [after - before for before, after in zip(base, dynamic, strict=True)]
    name = "Restricted mean time to success, Dynamic - Base"
    rows[name] = f"{_signed(fmean(changes), 1)} steps"
    if with_intervals:
        interval = mean_difference_interval(changes)
        rows[name] = f"{rows[name]} {_mean_interval_text(interval, changes)}"
        by_task = task_interval(changes, tasks, interval, bounds=(-math.inf, math.inf))
        if by_task.interval is not None:
            rows[f"{name}, for other tasks"] = f"{_ends(by_task.interval, 1)} steps, {by_task.tasks} tasks"
    fired = [record for record in records if record.triggered]
    rows["Pairs with an event"] = len(fired)
    for title, measure in (
        ("Median from event to success", _to_success),
        ("Median from event to the next stage", _to_next_stage),
    ):
        found = {arm: [measure(record, arm) for record in fired] for arm, _ in _ARMS}
        for arm, label in _ARMS:
            rows[f"{title}, {label}"] = _median_text(found[arm], with_intervals)
        both = [
            None if one is None or other is None else other - one
            for one, other in zip(found[BASE], found[DYNAMIC], strict=True)
        ]
        rows[f"{title}, Dynamic - Base where both have it"] = _median_text(both, with_intervals, signed=True)
    return {TITLE: rows | _motion(fired, with_intervals)}


def success_curves(records: Sequence[PairRecord]) -> SuccessCurves | None:
    """Return the numbers of pairs not yet completed by step; None without pairs."""
    if not records:
        return None
    ends = {
        arm: [arm_of.steps for record in records if (arm_of := record.arms[arm]).success] for arm, _ in _ARMS
    }
    steps = sorted({0, *ends[BASE], *ends[DYNAMIC], max(record.max_steps for record in records)})
    base, dynamic = (
        [len(records) - sum(end <= step for end in ends[arm]) for step in steps] for arm, _ in _ARMS
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


def _motion(fired: Sequence[PairRecord], with_intervals: bool) -> Rows:
    """Return the rows on way and jerk of pairs that the probe watched; empty without any."""
    watched = [record for record in fired if all(PROBE in record.arms[arm].probes for arm, _ in _ARMS)]
    if not watched:
        return {}

    def both(
        measure: Callable[[PairRecord, str], float | None], join: Callable[[float, float], float]
    ) -> str:
        pairs = [(measure(record, BASE), measure(record, DYNAMIC)) for record in watched]
        values = [None if a is None or b is None or not a else join(a, b) for a, b in pairs]
        return _median_text(values, with_intervals, unit="", digits=2)

    rows: Rows = {"Pairs whose motion was watched": len(watched)}
    rows["Median way of the hand to the event, the same in both arms"] = _median_text(
        [_way(record, BASE, before=True) for record in watched], with_intervals, unit="m", digits=2
    )
    for arm, label in _ARMS:
        rows[f"Median way after the event, {label}"] = _median_text(
            [_way(record, arm) for record in watched], with_intervals, unit="m", digits=2
        )
    rows["Median way after the event, Dynamic / Base where both succeed"] = both(
        lambda record, arm: _way(record, arm) if record.base_success and record.dynamic_success else None,
        lambda base, dynamic: dynamic / base,
    )
    rows["Median jerk to the event, the same in both arms"] = _median_text(
        [_jerk(record, BASE, before=True) for record in watched], with_intervals, unit="m/s^3", digits=1
    )
    for arm, label in _ARMS:
        rows[f"Median jerk after the event, {label}"] = _median_text(
            [_jerk(record, arm) for record in watched], with_intervals, unit="m/s^3", digits=1
        )
    rows["Median jerk after the event, Dynamic / Base"] = both(_jerk, lambda base, dynamic: dynamic / base)
    return rows


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


def _median_text(
    values: Sequence[float | None],
    with_interval: bool,
    *,
    unit: str = _STEPS,
    digits: int = 1,
    signed: bool = False,
) -> str:
    """Return the median of the values that exist, its interval, and the number of pairs that have one."""
    found = [value for value in values if value is not None]
    count = f"{len(found)}/{len(values)} pairs"
    if not found:
        return f"n/a  {count}"
    middle = median(found)
    text = _signed(middle, digits) if signed else f"{middle:.{digits}f}"
    interval = median_interval(found) if with_interval else None
    ends = f" {_ends(interval, digits)}" if interval else ""
    return f"{text}{f' {unit}' if unit else ''}{ends}  {count}"


def _mean_interval_text(interval: Interval | None, changes: Sequence[float]) -> str:
    if interval is not None:
        return _ends(interval, 1)
    return f"[n/a: {sum(change != 0 for change in changes)} of {LEAST_DIFFERENT} needed pairs differ]"


def _ends(interval: Interval, digits: int) -> str:
    return f"[{interval.lower:.{digits}f}, {interval.upper:.{digits}f}]"


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}" if value else f"{0:.{digits}f}"
