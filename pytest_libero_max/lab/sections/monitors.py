"""Failure monitors: do they notice the event, how soon, and before the policy fails?

A monitor is a probe that scores every query (:class:`.Monitor`). It raises an alarm at the first query whose
score is above a threshold. The threshold of a case comes from the Bases of the other half of the cases: the
smallest one above which the largest scores of at most a tenth of future Bases are expected to be (split
conformal prediction, V. Vovk, A. Gammerman and G. Shafer (2005), Algorithmic Learning in a Random World).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import NamedTuple

from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.measures import Measured, Rows
from pytest_libero_max.report.sections import PlayedPairs, ReportSection

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


class Monitors(ReportSection):
    """A table for each monitor that watched pairs."""

    name = "monitors"

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        watched: dict[str, list[PairRecord]] = {}
        for record in played.records:
            both = [record.arms[arm].probes for arm in (BASE, DYNAMIC)]
            for name in sorted(set(both[0]) & set(both[1])):
                if all(set(probes[name]) == COLUMNS for probes in both):
                    watched.setdefault(name, []).append(record)
        return {f"Monitor {name}": _alarms(name, watched[name]) for name in sorted(watched)}

    def quantity(self, name: str) -> Measured | None:
        kind, _, rest = name.partition(".")
        key = next((key for key in ROWS if kind == "monitor" and rest.endswith(f".{key}")), None)
        return None if key is None else _measured(rest.partition(".")[0], key, name)


def _measured(monitor: str, key: str, name: str = "") -> Measured:
    title, unit = ROWS[key]
    return Measured(name or f"monitor.{monitor}.{key}", title, unit, probe=monitor)


def _alarms(name: str, records: Sequence[PairRecord]) -> Rows:
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
    rows |= _measured(name, "false_alarms").share(raised)
    rows["Pairs in which the event happened"] = len(seen)
    if not seen:
        return rows
    base, dynamic = ([one.alarms[arm] is not None for one in seen] for arm in (0, 1))
    lost = [one for one in seen if one.record.base_success and not one.record.dynamic_success]
    rows |= _measured(name, "before").share([one.before for one in seen], with_interval=False)
    rows |= _measured(name, "alarm.base").share(base) | _measured(name, "alarm.dynamic").share(dynamic)
    rows |= _measured(name, "alarm.change").change(base, dynamic)
    rows |= _measured(name, "delay").median([_delay(one) for one in seen], with_interval=False)
    rows |= _measured(name, "regressions").share(one.alarms[1] is not None for one in lost)
    rows |= _measured(name, "lead").median([_lead(one) for one in lost], with_interval=False)
    for event in (event for event in EVENTS if any(one.record.event == event for one in seen)):
        some = [one for one in seen if one.record.event == event]
        own = {
            key: Measured(f"monitor.{name}.{event}.{key}", f"... {event}: {words}", unit)
            for key, words, unit in _BY_EVENT
        }
        for key, arm in (("alarm.base", 0), ("alarm.dynamic", 1)):
            rows |= own[key].share([one.alarms[arm] is not None for one in some], with_interval=False)
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
