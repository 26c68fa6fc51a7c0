"""Schedules and arms: a schedule is a tuple of entries, an arm is a name and a schedule.

:func:`arms_of` builds the arms of a case from its program (:mod:`pytest_libero_max.benchmark.programs`);
:func:`program_of` writes arms as a program.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from pytest_libero_max.benchmark.cases import Case, Event
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import seed_of
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.benchmark.programs import BASE as BASE
from pytest_libero_max.benchmark.programs import BASE_AGAIN as BASE_AGAIN
from pytest_libero_max.benchmark.programs import DYNAMIC as DYNAMIC
from pytest_libero_max.benchmark.programs import (
    EVENT,
    NAME,
    Program,
    check_entry,
    parse_program,
)
from pytest_libero_max.benchmark.programs import SHAM as SHAM
from pytest_libero_max.benchmark.programs import SHAM_DYNAMIC as SHAM_DYNAMIC
from pytest_libero_max.benchmark.structs import Positive, checked
from pytest_libero_max.errors import ChangeError, ManifestError, did_you_mean
from pytest_libero_max.events.triggers import StepsAfter, Trigger, trigger_from_dict

if TYPE_CHECKING:
    from pytest_libero_max.changes.change import Change

DRAWN = "drawn"
"""``{"drawn": [LEAST, MOST]}`` in a trigger of a program stands for a number drawn from the case's seed."""


@dataclass(frozen=True)
class Revert:
    """Takes back the change of an earlier entry of the schedule."""

    entry: int
    """Index of that entry, from 0."""


@dataclass(frozen=True)
class Entry:
    """One thing that happens in an arm."""

    trigger: Trigger
    """Moment of the entry. It is asked as soon as the entry before has happened."""
    action: Change | Revert
    """A change, or the reversal of an earlier entry's change."""

    def to_dict(self) -> Json:
        """As JSON values; :func:`schedule_from_list` reads them."""
        what: Json = (
            {"reverts": self.action.entry}
            if isinstance(self.action, Revert)
            else {"change": self.action.to_dict()}
        )
        return {"trigger": self.trigger.to_dict(), **what}


Schedule = tuple[Entry, ...]
"""Entries in the order in which they happen; the empty schedule is Base."""


@dataclass(frozen=True)
class Cadence:
    """Frequency of queries."""

    query_interval: int
    """Q (execution horizon, replan steps), the actions executed before the next query."""
    horizon: int | None = None
    """H (chunk size), the most actions a query may return; None for the policy's own."""

    def to_dict(self) -> Json:
        """JSON types, without ``horizon`` where it is the policy's own."""
        horizon = {} if self.horizon is None else {"horizon": self.horizon}
        return {"query_interval": self.query_interval, **horizon}


@dataclass(frozen=True)
class Arm:
    """One way of playing a case.

    Two arms share everything up to the first entry in which their schedules differ: it is executed once.

    Raises:
        ManifestError: The name is not one, or an entry refers to one that does not come before it.
    """

    name: str
    """Lower-case letters, digits and underscores; begins with a letter."""
    schedule: Schedule = ()
    """Changes of the arm with their triggers."""
    repetition: int = 0
    """Arms of another repetition share nothing: they are played from the start once more."""
    cadence: Cadence | None = None
    """Frequency of queries; None for the policy's own. Arms of another cadence share nothing."""
    latency: Latency = NO_LATENCY
    """Time that a query takes. Arms of another latency share nothing."""
    policy: str | None = None
    """Name of the policy that goes on from the first entry; None for that of Base. The executed prefix, and
    what is queued of it, are of the policy of Base. A cadence is then that of this policy."""
    at_once: bool = False
    """True if that policy is asked where it goes on, and its answer replaces what is queued; otherwise it is
    asked when the queued actions are executed."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name):
            raise ManifestError(
                f"arm name={self.name!r}, but must be lower-case letters, digits and underscores, with a "
                "letter first."
            )
        object.__setattr__(self, "schedule", tuple(self.schedule))
        reversed_entries: set[int] = set()
        for index, entry in enumerate(self.schedule):
            where = f"arm {self.name!r}, entry {index}"
            if isinstance(entry.trigger, StepsAfter) and entry.trigger.entry >= index:
                raise ManifestError(f"{where}: {entry.trigger} must refer to an earlier entry.")
            if isinstance(entry.trigger, StepsAfter) and index == 0:
                raise ManifestError(f"{where}: {entry.trigger} has no entry before it to count from.")
            if isinstance(entry.action, Revert):
                _check_reversal(entry.action, self.schedule[:index], reversed_entries, where)

    @property
    def is_late(self) -> bool:
        """True if queries take time, from the start or from a change on."""
        from pytest_libero_max.changes.nothing import DelayAnswers

        changes = any(isinstance(entry.action, DelayAnswers) for entry in self.schedule)
        return changes or self.latency != NO_LATENCY

    def to_dict(self) -> Json:
        """Return the arm as a program spells it."""
        values: Json = {"name": self.name, "schedule": [entry.to_dict() for entry in self.schedule]}
        if self.repetition:
            values["repetition"] = self.repetition
        if self.cadence is not None:
            values["cadence"] = self.cadence.to_dict()
        if self.latency != NO_LATENCY:
            values["latency"] = str(self.latency)
        if self.policy is not None:
            values["policy"] = self.policy
        if self.at_once:
            values["at_once"] = True
        return values


def _check_reversal(reversal: Revert, earlier: Schedule, done: set[int], where: str) -> None:
    if not 0 <= reversal.entry < len(earlier) or isinstance(earlier[reversal.entry].action, Revert):
        raise ManifestError(f"{where}: {reversal} must name an earlier entry that changes something.")
    if reversal.entry in done:
        raise ManifestError(f"{where}: entry {reversal.entry} is taken back already; leave this entry out.")
    done.add(reversal.entry)


def schedule_from_list(
    raw: Any, where: str = "schedule", event: Event | None = None, strength: float = 1.0
) -> Schedule:
    """Read a list of what :meth:`Entry.to_dict` wrote, or the schedule of a program.

    Args:
        event: Value for ``"event"``. None: the schedule does not refer to it.

    Raises:
        ManifestError: It has another form.
        ChangeError: A change is malformed, or cannot be scaled to this strength.
    """
    if not isinstance(raw, list):
        raise ManifestError(f"{where} must be a list of entries, not {type(raw).__name__}.")
    schedule: list[Entry] = []
    for index, item in enumerate(raw):
        values, at = check_entry(item, f"{where}[{index}]"), f"{where}[{index}]"
        times = range(values.get("times", 1))
        if event is None or not _draws(values["trigger"]):
            schedule += [_entry(values, at, event, strength)] * len(times)
            continue
        for _ in times:
            trigger = _drawn(values["trigger"], (event.seed, len(schedule)), f"{at}.trigger")
            schedule.append(_entry({**values, "trigger": trigger}, at, event, strength))
    return tuple(schedule)


def _draws(trigger: Any) -> bool:
    return isinstance(trigger, dict) and any(
        isinstance(value, dict) and DRAWN in value for value in trigger.values()
    )


def _drawn(trigger: Json, seed: tuple[int, int], where: str) -> Json:
    """Return a trigger with a number in the place of each ``{"drawn": [LEAST, MOST]}``."""
    numbers: Json = {}
    for key, value in trigger.items():
        if isinstance(value, dict) and DRAWN in value:
            least, most = checked(value, _Drawn, f"{where}.{key}", ManifestError).drawn
            if least > most:
                raise ManifestError.seen(
                    f"{where}.{key}", value, ", but the first number is the least. Exchange the two."
                )
            numbers[key] = least + seed_of(*seed, key) % (most - least + 1)
    return {**trigger, **numbers}


class _Drawn(Struct, frozen=True, forbid_unknown_fields=True):
    """A whole number of a trigger, any from the first to the second, drawn from the seed of the case."""

    drawn: tuple[Positive, Positive]


def _entry(values: Json, where: str, event: Event | None, strength: float) -> Entry:
    own = ({}, {}) if event is None else (event.trigger, event.change)
    trigger = trigger_from_dict(_filled(values["trigger"], *own, f"{where}.trigger"), f"{where}.trigger")
    if "reverts" in values:
        return Entry(trigger, Revert(values["reverts"]))
    change = _filled(values["change"], *own[::-1], f"{where}.change")
    try:
        return Entry(trigger, _change(change, strength * values.get("strength", 1.0)))
    except ChangeError as error:
        raise error.within(f"{where}.change") from error


def _filled(value: Any, own: Json, other: Json, where: str) -> Any:
    """Return the value with ``"event"`` and each ``{"event": FIELD}`` inside it replaced.

    Args:
        own: That of the event; empty where there is no event.
        other: The change or the trigger of the event: its fields may be named as well.
    """
    if not own:
        return value
    if value == EVENT:
        return own
    return {key: _field(item, {**other, **own}, f"{where}.{key}") for key, item in value.items()}


def _field(value: Any, own: Json, where: str) -> Any:
    if isinstance(value, list):
        return [_field(item, own, f"{where}[{index}]") for index, item in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if value.keys() != {EVENT}:
        return {key: _field(item, own, f"{where}.{key}") for key, item in value.items()}
    if value[EVENT] not in own:
        raise ManifestError.seen(
            where, value, f", but the case's event has no such field. {did_you_mean(value[EVENT], own)}"
        )
    return own[value[EVENT]]


def trigger_of(case: Case) -> Trigger:
    """Trigger of the case's event, or raise ManifestError."""
    return trigger_from_dict(case.event.trigger, f"case {case.case_id!r}: scenario.trigger")


def change_of(case: Case, strength: float = 1.0) -> Change:
    """Return the change of the case's event, or raise ChangeError.

    Args:
        strength: Share of the whole change, 0 to 1. At 0 nothing is changed.
    """
    return _change(case.event.change, strength)


def _change(raw: Any, strength: float) -> Change:
    from pytest_libero_max.changes.nothing import Nothing
    from pytest_libero_max.changes.registry import change_from_dict

    change = change_from_dict(raw)
    if strength == 1.0:
        return change
    scaled = change.scaled(strength)
    return Nothing() if strength == 0.0 else scaled


def arms_of(
    case: Case, repeat_base: bool = False, strength: float = 1.0, sham: bool = False
) -> tuple[Arm, ...]:
    """Return the arms of a case: Base, in which nothing happens, Dynamic, and those that its program adds.

    Args:
        case: The case. Without a program, its event happens in Dynamic.
        repeat_base: True to play Base a second time from the start, for the noise floor.
        strength: Share of every change, see :func:`change_of`.
        sham: True for two more arms, in which the policy is given other seeds at the first entry of Dynamic:
            ``sham``, in which nothing else happens, and ``sham_dynamic``, in which the event does. So both
            rollouts are played twice from the event on, each time with the policy's own chance.

    Raises:
        ManifestError: The program is malformed.
        ChangeError: A change is malformed, or cannot be scaled to this strength.
    """
    from pytest_libero_max.changes.nothing import ReseedPolicy

    spelled = () if case.program is None else case.program.arms
    where = "" if case.program is None else f"program {case.program.name!r}"
    arms = {
        raw["name"]: _arm(raw, f"{where}.arms[{i}]", case.event, strength) for i, raw in enumerate(spelled)
    }
    base = arms.pop(BASE, Arm(BASE))
    dynamic = arms.pop(DYNAMIC, None) or Arm(DYNAMIC, (Entry(trigger_of(case), change_of(case, strength)),))
    reseed = Entry(dynamic.schedule[0].trigger, ReseedPolicy())
    later = tuple(map(one_later, dynamic.schedule))
    shams = (Arm(SHAM, (reseed,)), Arm(SHAM_DYNAMIC, (reseed, *later))) if sham else ()
    again = (Arm(BASE_AGAIN, repetition=1),) if repeat_base else ()
    return (base, dynamic, *arms.values(), *shams, *again)


def one_later(entry: Entry) -> Entry:
    """Return an entry for a schedule with one more entry at its beginning; references move with it."""
    trigger, action = entry.trigger, entry.action
    if isinstance(trigger, StepsAfter) and trigger.entry >= 0:
        trigger = replace(trigger, entry=trigger.entry + 1)
    return Entry(trigger, Revert(action.entry + 1) if isinstance(action, Revert) else action)


def _arm(raw: Json, where: str, event: Event, strength: float) -> Arm:
    cadence = raw.get("cadence")
    schedule = schedule_from_list(raw.get("schedule", []), f"{where}.schedule", event, strength)
    try:
        return Arm(
            raw["name"],
            schedule,
            raw.get("repetition", 0),
            None if cadence is None else Cadence(cadence["query_interval"], cadence.get("horizon")),
            Latency.parse(raw["latency"]) if "latency" in raw else NO_LATENCY,
            raw.get("policy"),
            raw.get("at_once", False),
        )
    except ManifestError as error:
        raise error.within(where) from error


def program_of(name: str, arms: Iterable[Arm]) -> Program:
    """Arms as a program, for a manifest or a file.

    Args:
        name: The program's name.

    Raises:
        ManifestError: A name breaks its rule, something happens in Base, or nothing in Dynamic.
    """
    return parse_program({"name": name, "arms": [arm.to_dict() for arm in check_arms(arms)]})


def check_arms(arms: Iterable[Arm]) -> tuple[Arm, ...]:
    """Return the arms as a tuple, each name once, or raise ManifestError."""
    checked = tuple(arms)
    if not checked:
        raise ManifestError("no arm given, but a case is played in at least one.")
    seen: set[str] = set()
    quiet = {(arm.latency, arm.repetition) for arm in checked if not arm.schedule and arm.cadence is None}
    for arm in checked:
        if arm.policy is not None and (not arm.schedule or (arm.latency, arm.repetition) not in quiet):
            raise ManifestError(
                f"arm {arm.name!r} has policy={arm.policy!r}, which goes on where the arm parts from one in "
                "which nothing happens. Give it a schedule, and play an arm of the same latency and "
                "repetition without one."
            )
        if arm.name in seen:
            raise ManifestError(f"two arms are called {arm.name!r}. Give each a name of its own.")
        seen.add(arm.name)
    return checked
