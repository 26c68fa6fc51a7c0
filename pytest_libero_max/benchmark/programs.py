"""Programs: the arms of a case with their schedules, as plain data that needs no simulator.

A program is an object with a ``name`` and a list of ``arms``, in a case of a manifest or in a file of its own
that is laid over the cases of a run. An arm is a ``name`` and a ``schedule``: entries that happen one after
another, each with a ``trigger`` and either a ``change`` or the index of an earlier entry it ``reverts``::

    {"name": "transient", "arms": [
      {"name": "dynamic", "schedule": [
        {"trigger": "event", "change": "event"},
        {"trigger": {"type": "steps_after", "steps": 20}, "reverts": 0}]}]}

The word ``"event"`` stands for the trigger or the change of the case's own event, and ``{"event": FIELD}``
inside a trigger or a change for one of its fields. ``base`` and ``dynamic`` are part of every program; where
they are not spelled out, nothing happens in Base, and the case's event happens in Dynamic.
:mod:`pytest_libero_max.events.schedules` turns programs into triggers and changes.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import (
    Json,
    canonical_digest,
    read_content,
    refuse_constant,
    require_count,
    require_keys,
    require_object,
    require_text,
)
from pytest_libero_max.errors import ManifestError, OptionError

BASE = "base"
DYNAMIC = "dynamic"
BASE_AGAIN = "base_again"
"""The arm of the noise floor: Base, played a second time from the start. No program has it."""

SHAM = "sham"
"""The arm of the sham event: at the event's moment the policy is given other seeds, and nothing changes."""

EVENT = "event"
"""Stands for the trigger or the change of the case's event."""

NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Program:
    """The arms of a case with their schedules, as spelled in a manifest or a file.

    Attributes:
        name: Lower-case letters, digits and underscores; ends the ids of the test items.
        arms: The arms that are spelled out, in the order in which they are played.
        path: The file that it was read from; None where there is none.
    """

    name: str
    arms: tuple[Json, ...]
    path: Path | None = field(default=None, compare=False)

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON of the program, hexadecimal."""
        return canonical_digest(self.to_dict())

    def to_dict(self) -> Json:
        """JSON types; :func:`parse_program` reads them."""
        return {"name": self.name, "arms": list(self.arms)}


def load_program(path: Path) -> Program:
    """Read a program from a JSON file.

    Raises:
        OptionError: The file cannot be read, is not JSON, or breaks the format; names it.
    """
    try:
        document = json.loads(read_content(path).decode(), parse_constant=refuse_constant)
    except (OSError, ValueError, RecursionError) as error:
        raise OptionError(
            f"Cannot read program {str(path)!r}: {error}. Give the path of a JSON file.", path=path
        ) from error
    try:
        return replace(parse_program(document), path=path)
    except ManifestError as error:
        raise OptionError(f"{path}: {error}", field=error.field, value=error.value, path=path) from error


def program_of_run(protocol: Json) -> Program | None:
    """Return the program that was laid over the cases of a run, from its header; None where there was none.

    Raises:
        ManifestError: It breaks the format.
    """
    said = protocol.get("program")
    if said is None:
        return None
    return parse_program({key: value for key, value in said.items() if key != "digest"})


def parse_program(value: Any, where: str = "program") -> Program:
    """Check the form of a program; whether its triggers and changes exist is checked where they are built.

    Args:
        value: The decoded JSON object.
        where: Name of it in an error.

    Raises:
        ManifestError: It breaks the format.
    """
    program = require_object(value, where)
    require_keys(program, where, {"name", "arms"})
    name = require_name(program, where)
    arms = program["arms"]
    if not isinstance(arms, list) or not arms:
        raise ManifestError.seen(f"{where}.arms", arms, ", but must be a non-empty list of arms.")
    seen: set[str] = set()
    for i, arm in enumerate(arms):
        called = _check_arm(arm, f"{where}.arms[{i}]")
        if called in seen:
            raise ManifestError.seen(
                f"{where}.arms[{i}].name", called, " of two arms. Give each a name of its own."
            )
        seen.add(called)
    return Program(name, tuple(dict(arm) for arm in arms))


def require_name(value: Json, where: str) -> str:
    """Return the field ``name`` as a word of ids.

    Raises:
        ManifestError: It is not one.
    """
    name = value.get("name")
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ManifestError.seen(
            f"{where}.name",
            name,
            ", but must be lower-case letters, digits and underscores, with a letter first.",
        )
    return name


def _check_arm(value: Any, where: str) -> str:
    """Return the name of an arm that is spelled as it must be."""
    arm = require_object(value, where)
    require_keys(arm, where, {"name"}, ("schedule", "repetition", "cadence"))
    name = require_name(arm, where)
    for taken, option in ((BASE_AGAIN, "noise-floor"), (SHAM, "sham")):
        if name == taken:
            raise ManifestError.seen(
                f"{where}.name",
                name,
                f" is the arm that --libero-max-{option} adds. Use that option, or another name.",
            )
    schedule = arm.get("schedule", [])
    if not isinstance(schedule, list):
        raise ManifestError(f"{where}.schedule must be a list of entries, not {type(schedule).__name__}.")
    for i, entry in enumerate(schedule):
        check_entry(entry, f"{where}.schedule[{i}]")
    if name in (BASE, DYNAMIC) and arm.keys() & {"repetition", "cadence"}:
        raise ManifestError(
            f"{where}: {name!r} has a repetition or a cadence, but Base and Dynamic share their prefix. Give "
            "them to an arm of another name."
        )
    if (name == BASE and schedule) or (name == DYNAMIC and not schedule):
        what = "nothing happens in Base" if name == BASE else "something happens in Dynamic"
        raise ManifestError.seen(f"{where}.schedule", schedule, f" of arm {name!r}, but {what}.")
    if "repetition" in arm:
        require_count(arm, "repetition", where)
    if "cadence" in arm:
        _check_cadence(arm["cadence"], f"{where}.cadence")
    return name


def check_entry(value: Any, where: str) -> Json:
    """Return the entry of a schedule as an object of the right form.

    Raises:
        ManifestError: It has another form.
    """
    entry = require_object(value, where)
    kind = "reverts" if "reverts" in entry else "change"
    require_keys(entry, where, {"trigger", kind}, ("strength",) if kind == "change" else ())
    for key, inner in (("trigger", "type"), ("change", "operation")):
        if key in entry and entry[key] != EVENT:
            require_text(require_object(entry[key], f"{where}.{key}"), inner, f"{where}.{key}")
    if kind == "reverts":
        require_count(entry, "reverts", where)
    strength = entry.get("strength", 1.0)
    if isinstance(strength, bool) or not isinstance(strength, int | float) or not 0 < strength <= 1:
        raise ManifestError.seen(f"{where}.strength", strength, ", but must be a number above 0, at most 1.")
    return entry


def _check_cadence(value: Any, where: str) -> None:
    cadence = require_object(value, where)
    require_keys(cadence, where, {"query_interval"}, ("horizon",))
    interval = require_count(cadence, "query_interval", where)
    horizon = require_count(cadence, "horizon", where) if "horizon" in cadence else interval
    if not 1 <= interval <= horizon:
        raise ManifestError(
            f"{where} has query_interval={interval} and horizon={horizon}, but 1 <= Q <= H: a query returns "
            "at most H actions, of which Q are executed."
        )
