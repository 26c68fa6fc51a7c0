"""What happens in an arm, and when: a schedule is a tuple of entries, an arm a name and a schedule."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json, require_count, require_keys, require_object
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.triggers import StepsAfter, Trigger, trigger_from_dict

if TYPE_CHECKING:
    from pytest_libero_max.changes.base import Change

BASE = "base"
DYNAMIC = "dynamic"
BASE_AGAIN = "base_again"
"""The arm of the noise floor: Base, played a second time from the start."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Revert:
    """Takes back what an earlier entry of the schedule changed.

    Attributes:
        entry: Index of that entry, from 0.
    """

    entry: int


@dataclass(frozen=True)
class Entry:
    """One thing that happens in an arm.

    Attributes:
        trigger: When. It is asked as soon as the entry before has happened.
        action: What: a change, or the reversal of an earlier entry's change.
    """

    trigger: Trigger
    action: Change | Revert

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
    """How often a policy is asked.

    Attributes:
        query_interval: Q, the actions executed before the next query.
        horizon: H, the most actions a query may return; None for the policy's own.
    """

    query_interval: int
    horizon: int | None = None


@dataclass(frozen=True)
class Arm:
    """One way of playing a case.

    Two arms share everything up to the first entry in which their schedules differ: it is executed once.

    Attributes:
        name: Lower-case letters, digits and underscores; begins with a letter.
        schedule: What happens in it, and when.
        repetition: Arms of another repetition share nothing: they are played from the start once more.
        cadence: How often the policy is asked; None as it declares. Arms of another cadence share nothing.

    Raises:
        ManifestError: The name is not one, or an entry refers to one that does not come before it.
    """

    name: str
    schedule: Schedule = ()
    repetition: int = 0
    cadence: Cadence | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
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


def _check_reversal(reversal: Revert, earlier: Schedule, done: set[int], where: str) -> None:
    if not 0 <= reversal.entry < len(earlier) or isinstance(earlier[reversal.entry].action, Revert):
        raise ManifestError(f"{where}: {reversal} must name an earlier entry that changes something.")
    if reversal.entry in done:
        raise ManifestError(f"{where}: entry {reversal.entry} is taken back already; leave this entry out.")
    done.add(reversal.entry)


def schedule_from_list(raw: Any, where: str = "schedule") -> Schedule:
    """Read a list of what :meth:`Entry.to_dict` wrote.

    Raises:
        ManifestError: It has another form.
        ChangeError: A change is malformed.
    """
    from pytest_libero_max.changes.registry import change_from_dict

    if not isinstance(raw, list):
        raise ManifestError(f"{where} must be a list of entries, not {type(raw).__name__}.")
    entries = []
    for index, item in enumerate(raw):
        place = f"{where}[{index}]"
        values = require_object(item, place)
        kind = "reverts" if "reverts" in values else "change"
        require_keys(values, place, {"trigger", kind})
        action = (
            Revert(require_count(values, "reverts", place))
            if kind == "reverts"
            else change_from_dict(values["change"])
        )
        entries.append(Entry(trigger_from_dict(values["trigger"], f"{place}.trigger"), action))
    return tuple(entries)


def trigger_of(case: Case) -> Trigger:
    """When the case's event happens."""
    return trigger_from_dict(case.event.trigger.to_dict(), f"case {case.case_id!r}: trigger")


def change_of(case: Case, strength: float = 1.0) -> Change:
    """What the case's event changes.

    Args:
        case: The case.
        strength: Share of the whole change, 0 to 1. At 0 nothing is changed.

    Raises:
        ChangeError: The change is malformed, or cannot be scaled to this strength.
    """
    from pytest_libero_max.changes.nothing import Nothing
    from pytest_libero_max.changes.registry import change_from_dict

    change = change_from_dict(case.event.change)
    if strength == 1.0:
        return change
    scaled = change.scaled(strength)
    return Nothing() if strength == 0.0 else scaled


def arms_of(case: Case, repeat_base: bool = False, strength: float = 1.0) -> tuple[Arm, ...]:
    """The arms of a pair: Base, in which nothing happens, and Dynamic, in which the case's event does.

    Args:
        case: The case.
        repeat_base: Whether Base is played a second time from the start, for the noise floor.
        strength: Share of the event's change, see :func:`change_of`.

    Raises:
        ChangeError: The event's change is malformed, or cannot be scaled to this strength.
    """
    event = Entry(trigger_of(case), change_of(case, strength))
    again = (Arm(BASE_AGAIN, repetition=1),) if repeat_base else ()
    return (Arm(BASE), Arm(DYNAMIC, (event,)), *again)


def check_arms(arms: Iterable[Arm]) -> tuple[Arm, ...]:
    """The arms as a tuple, each name once.

    Raises:
        ManifestError: There is none, or a name occurs twice.
    """
    checked = tuple(arms)
    if not checked:
        raise ManifestError("no arm given, but a case is played in at least one.")
    seen: set[str] = set()
    for arm in checked:
        if arm.name in seen:
            raise ManifestError(f"two arms are called {arm.name!r}. Give each a name of its own.")
        seen.add(arm.name)
    return checked
