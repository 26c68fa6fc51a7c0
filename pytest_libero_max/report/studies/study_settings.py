"""Settings: arms that differ from Base and Dynamic in cadence, latency or policy alone, pair by pair."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import asdict

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.record_rules import CONTROL_HZ
from pytest_libero_max.report.studies.study_document import Setting
from pytest_libero_max.runs.outcomes import columns_of
from pytest_libero_max.stats.blocks import BestSetting
from pytest_libero_max.stats.comparison import best_of
from pytest_libero_max.stats.measured import BoolArray, number, table_change_of, tabulate
from pytest_libero_max.stats.paired import measure
from pytest_libero_max.stats.ratios import Ratio

_EVENT = [{"trigger": "event", "change": "event"}]
"""Schedule of Dynamic, where a program does not spell it."""


class PlayedSetting(NamedTuple):
    """A cadence, a latency and a policy, and the arms that were played so."""

    policy: str
    """Name of the policy that goes on from the event; empty for that of Base."""
    latency: Latency
    query_interval: int
    horizon: int
    base: str = BASE
    dynamic: str = DYNAMIC

    @property
    def way(self) -> tuple[Any, ...]:
        return self[:4]

    @property
    def place(self) -> tuple[Any, ...]:
        return (self.policy, self.latency.steps, self.latency.runner, str(self.latency), *self[2:4])


def settings_of(arms: Sequence[Json], records: Sequence[PairRecord]) -> list[PlayedSetting]:
    """Return the settings that arms spell, in the order of tables, the run's own one included.

    One that is the policy's own is the pair of Base and Dynamic.

    Args:
        records: Measured cases, at least one, for what is the policy's own.
    """
    spelled = {arm["name"]: [*map(_as_short, arm.get("schedule", []))] for arm in arms}
    of_dynamic = spelled.get(DYNAMIC, _EVENT)
    own = PlayedSetting(*_way({"name": DYNAMIC}, records))
    ways: dict[tuple[Any, ...], dict[str, Any]] = {}
    for arm in arms:
        schedule = spelled[arm["name"]]
        if arm.keys() & {"cadence", "latency", "policy"} and schedule in ([], of_dynamic):
            ways.setdefault(_way(arm, records), {})["dynamic" if schedule else "base"] = arm["name"]
    settings = {own.way: own}
    for way, parts in ways.items():
        if way[0]:  # this policy goes on from a Base of the same latency
            parts = {**ways.get(("", *way[1:2], *own.way[2:]), {}), **parts}
        if {*parts} >= ({"dynamic"} if way[0] else {"base", "dynamic"}):
            settings.setdefault(way, PlayedSetting(*way, **parts))
    return sorted(settings.values(), key=lambda setting: setting.place) if len(settings) > 1 else []


def _as_short(entry: Json) -> Json:
    """Return an entry of a schedule without what it has by default."""
    usual = {"strength": 1.0, "times": 1}
    return {key: value for key, value in entry.items() if usual.get(key) != value}


def own_ways(arms: Sequence[Json], records: Sequence[PairRecord], names: Iterable[str]) -> dict[str, str]:
    """Return policy, H and Q, and latency of the arms that have their own, in words.

    Args:
        arms: The arms of a program or a study, as data; what they lack is read from the records.
    """
    spelled = {arm["name"]: arm for arm in arms}
    ways = {}
    for name in names:
        first = next(record for record in records if name in record.arms)
        played, base = first.arms[name], first.arm(BASE)
        cadence = {"H": "horizon", "Q": "query_interval"}
        arm = spelled.get(name, {})
        own = {key: value for key, value in arm.get("cadence", {}).items() if first.policy.get(key) != value}
        spec = own | (played.policy or {})
        words = [f"policy {arm.get('policy', spec['name'])}"] if played.policy else []
        words += [" ".join(f"{letter}={spec[key]}" for letter, key in cadence.items() if key in spec)]
        if played.latency is not None and played.latency != base.latency:
            words.append(latency_words(Latency.parse(played.latency), played.control_hz))
        if text := ", ".join(filter(None, words)):
            ways[name] = text
    return ways


def _way(arm: Json, records: Sequence[PairRecord]) -> tuple[Any, ...]:
    name, played = arm.get("policy", ""), (record.arms.get(arm["name"]) for record in records)
    spec = next((one.policy for one in played if one is not None and one.policy), records[0].policy)
    cadence, text = arm.get("cadence", {}), arm.get("latency", records[0].arm(BASE).latency)
    return (
        name,
        NO_LATENCY if text is None else Latency.parse(text),
        cadence.get("query_interval", spec["query_interval"]),
        cadence.get("horizon", spec["horizon"]),
    )


def measured_settings(
    settings: Sequence[PlayedSetting], records: Sequence[PairRecord], tasks: Sequence[str]
) -> list[Setting]:
    """Compute everything that is reported of settings."""
    labels = _labels(settings, records)
    return [_measured(*one, records, tasks) for one in zip(settings, labels, strict=True)]


def best_settings(settings: Sequence[PlayedSetting], records: Sequence[PairRecord]) -> dict[str, BestSetting]:
    """Return the best setting for Base and for Dynamic, of those that every case was played in."""
    best = {}
    for part in ("base", "dynamic"):
        arms: dict[str, str] = {}  # settings of several policies may have one Base
        for label, setting in zip(_labels(settings, records), settings, strict=True):
            if all({setting.base, setting.dynamic} <= record.arms.keys() for record in records):
                arms.setdefault(getattr(setting, part), label)
        best[f"{part}_success"] = best_of({label: _ends(records, arm) for arm, label in arms.items()})
    return best


def _labels(settings: Sequence[PlayedSetting], records: Sequence[PairRecord]) -> list[str]:
    varies = [len({setting[place] for setting in settings}) > 1 for place in range(4)]
    of_base = str(records[0].policy["name"]) if records else ""
    hz = records[0].control_hz if records else CONTROL_HZ
    return [" ".join(_words(setting, varies, of_base, hz)) for setting in settings]


def _words(setting: PlayedSetting, varies: Sequence[bool], of_base: str, hz: int) -> Iterator[str]:
    if varies[0]:
        yield f"{setting.policy} after {of_base}" if setting.policy else of_base
    if varies[1]:
        yield latency_words(setting.latency, hz)
    if varies[2] or varies[3]:
        yield f"H={setting.horizon} Q={setting.query_interval}"


def latency_words(latency: Latency, hz: int) -> str:
    """Return a latency for tables: ``d=2 (100 ms)``, or the range that it is drawn from."""
    if latency.drawn:
        return str(latency)
    sync = " sync" if latency.runner == "sync" else ""
    return f"d={latency.steps} ({1000 * latency.steps // hz} ms){sync}"


def _measured(
    setting: PlayedSetting, label: str, records: Sequence[PairRecord], tasks: Sequence[str]
) -> Setting:
    names = (setting.base, setting.dynamic)
    rows = [
        (record, task)
        for record, task in zip(records, tasks, strict=True)
        if not setting.policy or {*names} <= record.arms.keys()  # a policy may not play every suite
    ]
    played = [record for record, _ in rows]
    arms = [record.arm(name) for record in played for name in names]
    columns = columns_of(played, [task for _, task in rows], *names)
    costs: dict[str, Any] = {
        f"{part}_cost": None
        if name == part  # a contrast with itself
        else table_change_of(tabulate(_ends(played, part), _ends(played, name)))
        for part, name in zip((BASE, DYNAMIC), names, strict=True)
    }
    spans = [arm.returned[1] for arm in arms if arm.returned]
    return Setting(
        **asdict(measure(columns)),
        label=label,
        own=names == (BASE, DYNAMIC),
        horizon=setting.horizon,
        query_interval=setting.query_interval,
        returned=max([setting.horizon, *spans, *([] if setting.policy else [records[0].policy["horizon"]])]),
        steps=setting.latency.steps,
        runner=setting.latency.runner,
        policy=setting.policy or None,
        held=number(Ratio(sum(arm.held_steps or 0 for arm in arms), sum(arm.steps for arm in arms)).value),
        **costs,
    )


def _ends(records: Sequence[PairRecord], arm: str) -> BoolArray:
    return np.array([record.arm(arm).success for record in records], dtype=np.bool_)
