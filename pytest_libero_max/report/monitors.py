"""Failure monitors: do they notice the event, how soon, and before the policy fails?

A monitor is a probe that scores every query (:class:`.Monitor`). It raises an alarm at the first query whose
score is above a threshold. The threshold of a case comes from the Bases of the other half of the cases: the
smallest one above which the largest scores of at most a tenth of future Bases are expected to be (split
conformal prediction, V. Vovk, A. Gammerman and G. Shafer (2005), Algorithmic Learning in a Random World).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from typing import NamedTuple

from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.measures import Measured, Rows
from pytest_libero_max.stats.measured import rate_of, ratio_of, table_change_of
from pytest_libero_max.stats.outcome_table import tabulate
from pytest_libero_max.stats.ratios import Ratio

COLUMNS = {"step", "score"}
"""Those of a monitor."""

FALSE_ALARMS = 0.1
"""Share of the Bases that may raise an alarm."""

LEAST = math.ceil(1 / FALSE_ALARMS) - 1
"""Bases that a threshold needs."""


ROWS = {
    "false_alarms": (f"Base with an alarm ({FALSE_ALARMS:.0%} are allowed)", "share"),
    "before": ("Alarm before the event already", "share"),
    "alarm.base": ("Alarm after the event, Base at the same step", "share"),
    "alarm.dynamic": ("Alarm after the event, Dynamic", "share"),
    "alarm.change": ("Alarm after the event, paired change", "change"),
    "delay": ("Steps from event to alarm, median", "steps"),
    "regressions": ("Regressions with an alarm after the event", "share"),
    "lead": ("Steps from alarm to the end of a regression, median", "steps"),
}
"""Titles and units of the quantities of a monitor, by the end of their names in gates."""

_BY_EVENT = (
    ("alarm.base", "alarm in Base", "share"),
    ("alarm.dynamic", "alarm in Dynamic", "share"),
    ("delay", "steps to it, median", "steps"),
)


class _Watched(NamedTuple):
    """A pair that a monitor watched, and in which the event happened."""

    record: PairRecord
    """The pair."""
    step: int
    """Policy steps before the event."""
    alarms: tuple[int | None, int | None]
    """For Base and Dynamic: the policy step of the first alarm after the event, None without one."""
    before: bool
    """True if there was an alarm before the event."""


def monitor_sections(records: Iterable[PairRecord], *, with_intervals: bool = True) -> dict[str, Rows]:
    """Return a section of the report for each monitor that watched pairs; empty without any.

    Args:
        records: Played pairs.
        with_intervals: False where a rule has ended the run: intervals are for a fixed number of pairs.
    """
    watched: dict[str, list[PairRecord]] = {}
    for record in records:
        both = [record.arms[arm].probes for arm in (BASE, DYNAMIC)]
        for name in sorted(set(both[0]) & set(both[1])):
            if all(set(probes[name]) == COLUMNS for probes in both):
                watched.setdefault(name, []).append(record)
    return {f"Monitor {name}": _section(name, watched[name], with_intervals) for name in sorted(watched)}


def _section(name: str, records: Sequence[PairRecord], with_intervals: bool) -> Rows:
    halves = [[record for record in records if _half(record) == half] for half in (0, 1)]
    rows: Rows = {"Pairs watched": len(records)}
    if min(map(len, halves)) < LEAST:
        return rows | {
            "Alarms": f"n/a: a threshold needs {LEAST} pairs in each half, but there are "
            f"{' and '.join(str(len(half)) for half in halves)}"
        }
    thresholds = [_threshold(name, halves[1 - half]) for half in (0, 1)]
    seen = [
        _watch(name, record, step, thresholds[_half(record)])
        for record in records
        if (step := record.trigger_step) is not None
    ]
    raised = [
        any(score > thresholds[_half(record)] for _, score in _scores(name, record.arms[BASE]))
        for record in records
    ]
    quantities = {key: Measured(f"monitor.{name}.{key}", *row) for key, row in ROWS.items()}

    def share(key: str, values: Sequence[bool], with_interval: bool = with_intervals) -> Rows:
        ratio = Ratio(sum(values), len(values))
        return quantities[key].ratio(rate_of(ratio, with_interval=with_interval))

    rows |= share("false_alarms", raised)
    rows["Pairs in which the event happened"] = len(seen)
    if not seen:
        return rows
    base, dynamic = ([one.alarms[arm] is not None for one in seen] for arm in (0, 1))
    lost = [one for one in seen if one.record.base_success and not one.record.dynamic_success]
    change = table_change_of(tabulate(base, dynamic), with_interval=with_intervals)
    rows |= share("before", [one.before for one in seen], False)
    rows |= share("alarm.base", base) | share("alarm.dynamic", dynamic)
    rows |= quantities["alarm.change"].ratio(change)
    rows |= quantities["delay"].median([_delay(one) for one in seen], with_interval=False)
    rows |= share("regressions", [one.alarms[1] is not None for one in lost])
    rows |= quantities["lead"].median([_lead(one) for one in lost], with_interval=False)
    for event in (event for event in EVENTS if any(one.record.event == event for one in seen)):
        some = [one for one in seen if one.record.event == event]
        own = {
            key: Measured(f"monitor.{name}.{event}.{key}", f"... {event}: {words}", unit)
            for key, words, unit in _BY_EVENT
        }
        for key, arm in (("alarm.base", 0), ("alarm.dynamic", 1)):
            raised = [one.alarms[arm] is not None for one in some]
            rows |= own[key].ratio(ratio_of(Ratio(sum(raised), len(raised))))
        rows |= own["delay"].median([_delay(one) for one in some], with_interval=False)
    return rows


def _half(record: PairRecord) -> int:
    """Return the half of a case, 0 or 1, by the digest of its name."""
    return sha256(record.case_id.encode()).digest()[0] % 2


def _scores(name: str, arm: ArmRecord) -> list[tuple[int, float]]:
    columns: Mapping[str, object] = arm.probes[name]
    steps, scores = columns["step"], columns["score"]
    assert isinstance(steps, list)
    assert isinstance(scores, list)
    return list(zip(steps, scores, strict=True))


def _threshold(name: str, records: Sequence[PairRecord]) -> float:
    """Return the conformal quantile of the largest scores of some Bases."""
    largest = sorted(
        max((score for _, score in _scores(name, record.arms[BASE])), default=-math.inf) for record in records
    )
    return largest[math.ceil((1 - FALSE_ALARMS) * (len(largest) + 1)) - 1]


def _watch(name: str, record: PairRecord, step: int, threshold: float) -> _Watched:
    alarms = [
        [at for at, score in _scores(name, record.arms[arm]) if score > threshold] for arm in (BASE, DYNAMIC)
    ]
    base, dynamic = (next((at for at in arm if at >= step), None) for arm in alarms)
    before = any(at < step for at in alarms[1])
    return _Watched(record, step, (base, dynamic), before)


def _delay(one: _Watched) -> int | None:
    return None if one.alarms[1] is None else one.alarms[1] - one.step


def _lead(one: _Watched) -> int | None:
    steps = one.record.arms[DYNAMIC].steps
    return None if one.alarms[1] is None or steps is None else steps - one.alarms[1]
