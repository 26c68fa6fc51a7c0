"""Programs: the arms of a case with their schedules, as plain data that needs no simulator.

A program is an object with a ``name`` and a list of ``arms``, in a case of a manifest or in a file of its own
(JSON or TOML) that is laid over the cases of a run. An arm is a ``name`` and a ``schedule``: entries that
happen one after another, each with a ``trigger`` and either a ``change`` or the index of an earlier entry it
``reverts``::

    {"name": "transient", "arms": [
      {"name": "dynamic", "schedule": [
        {"trigger": "event", "change": "event"},
        {"trigger": {"type": "steps_after", "steps": 20}, "reverts": 0}]}]}

The word ``"event"`` stands for the trigger or the change of the case's own event, and ``{"event": FIELD}``
inside a trigger or a change for one of its fields. An arm may also have a ``cadence``, a ``latency`` and a
``policy``, the name of the one that goes on from its first entry, ``at_once`` or after the queued actions.
``base`` and ``dynamic`` are part of every program; where they are not spelled out, nothing happens in Base,
and the case's event happens in Dynamic.
:mod:`pytest_libero_max.events.schedules` turns programs into triggers and changes.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, TypeVar

from msgspec import Struct

from pytest_libero_max.benchmark.documents import (
    Json,
    canonical_digest,
    read_content,
    read_text,
    refuse_constant,
    text_of,
)
from pytest_libero_max.benchmark.latency import PATTERN as LATENCY
from pytest_libero_max.benchmark.structs import Count, Object, Positive, Text, Word, checked, rule
from pytest_libero_max.errors import ManifestError, OptionError, did_you_mean

T = TypeVar("T")

FOLDER = Path(__file__).with_name("named_programs")
"""The programs of this package, a file each."""

BASE = "base"
DYNAMIC = "dynamic"
BASE_AGAIN = "base_again"
"""The arm of the noise floor: Base, played a second time from the start. No program has it."""

SHAM = "sham"
"""The arm of the sham event: at the event's moment the policy is given other seeds, and nothing changes."""

SHAM_DYNAMIC = "sham_dynamic"
"""The arm of the event with other seeds from its moment on, beside Dynamic as ``sham`` is beside Base."""

EVENT = "event"
"""Stands for the trigger or the change of the case's event."""

NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Program:
    """The arms of a case with their schedules, as spelled in a manifest or a file."""

    name: str
    """Lower-case letters, digits and underscores; ends the ids of the test items."""
    arms: tuple[Json, ...]
    """The arms that are spelled out, in the order in which they are played."""
    about: str = field(default="", compare=False)
    """Description of what is played; empty where it has none."""
    only: Mapping[str, tuple[str, ...]] = field(default_factory=dict, compare=False)
    """Patterns of the cases that it fits, by ``event``, ``operation`` (of its change), ``suite`` and
    ``entity`` (of its trigger); a case has to match one of each. Empty: it fits all."""
    without: Mapping[str, tuple[str, ...]] = field(default_factory=dict, compare=False)
    """Patterns of the cases that it does not fit, likewise: none may match."""
    because: str = field(default="", compare=False)
    """Why it does not fit the others, in words."""
    source: str = field(default="", compare=False)
    """Name under which it comes with the package, or the path of its file; empty where it has none."""

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON of the program, hexadecimal."""
        return canonical_digest(self.to_dict())

    def fits(self, **case: str) -> bool:
        """Return True if the program makes sense in a case, as far as the program says it."""
        return all(_matches(case[key], patterns) for key, patterns in self.only.items()) and not any(
            _matches(case[key], patterns) for key, patterns in self.without.items()
        )

    def varies(self, key: str) -> bool:
        """Return True if an arm has a ``cadence``, ``latency`` or ``policy`` of its own."""
        return any(key in arm for arm in self.arms)

    def to_dict(self) -> Json:
        """Return what is played, as JSON types that :func:`parse_program` reads."""
        return {"name": self.name, "arms": list(self.arms)}


def _matches(value: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(value, pattern) for pattern in patterns)


_Name = Annotated[
    str,
    rule("lower-case letters, digits and underscores, with a letter first", pattern=rf"^{NAME.pattern}\Z"),
]


class _Spelled(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of a program: exactly these fields."""


_Patterns = Annotated[tuple[Text, ...], rule("a non-empty list of patterns", min_length=1)] | None


class _Cases(_Spelled, frozen=True):
    event: _Patterns = None
    operation: _Patterns = None
    suite: _Patterns = None
    entity: _Patterns = None


class _Program(_Spelled, frozen=True):
    name: _Name
    arms: Annotated[tuple[Object, ...], rule("a non-empty list of arms", min_length=1)]
    about: Text = ""
    only: _Cases = _Cases()
    without: _Cases = _Cases()
    because: Text = ""


class _Cadence(_Spelled, frozen=True):
    query_interval: Count
    horizon: Positive = 0
    """0 where it is not given: that of ``query_interval``."""


class _Arm(_Spelled, frozen=True):
    name: _Name
    schedule: Annotated[tuple[Any, ...], rule("a list of entries")] = ()
    repetition: Count = 0
    cadence: _Cadence = _Cadence(1)
    latency: Annotated[str, rule("steps, for example 4steps or 4steps,sync", pattern=LATENCY)] = "0steps"
    policy: Annotated[str, rule("the name of a policy, no file and no address", pattern=r"^[\w-]+\Z")] = "own"
    at_once: bool = False


class _Happening(_Spelled, frozen=True):
    trigger: Any
    change: Any
    strength: Annotated[float, rule("a number above 0, at most 1", gt=0, le=1)] = 1.0
    times: Positive = 1


class _Reversal(_Spelled, frozen=True):
    trigger: Any
    reverts: Count


def program_names() -> tuple[str, ...]:
    """Return the names of the programs of this package, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.json")))


def find_program(text: str, folder: Path = Path()) -> Program:
    """Return a program of this package, or one from a file, or raise OptionError."""
    if text in program_names():
        return replace(load_program(FOLDER / f"{text}.json"), source=text)
    path = folder / Path(text).expanduser()
    if not path.exists() and not path.suffix:
        raise OptionError.seen(
            "program",
            text,
            f": there is no such program, nor a file. {did_you_mean(text, program_names())} "
            "`libero-max list programs` lists them.",
        )
    return load_program(path)


def load_program(path: Path) -> Program:
    """Read a program from a JSON or TOML file, or raise OptionError."""
    return replace(read_document(path, "program", parse_program), source=str(path))


def read_document(path: Path, noun: str, parse: Callable[[Any], T]) -> T:
    """Return what a JSON or TOML file spells.

    Raises:
        OptionError: The file cannot be read, is of neither format, or breaks a rule; names it.
    """
    try:
        if path.suffix == ".toml":
            document = tomllib.loads(read_text(path))
        else:
            document = json.loads(text_of(read_content(path)), parse_constant=refuse_constant)
    except (OSError, ValueError, RecursionError) as error:
        raise OptionError(
            f"Cannot read {noun} {str(path)!r}: {error}. Give the path of a JSON or TOML file.", path=path
        ) from error
    try:
        return parse(document)
    except ManifestError as error:
        raise OptionError(f"{path}: {error}", field=error.field, value=error.value, path=path) from error


def program_of_run(protocol: Json) -> Program | None:
    """Return the program that was laid over the cases of a run, from its header; None where there was none.

    Raises:
        ManifestError: It breaks the format.
    """
    recorded = protocol.get("program")
    if recorded is None:
        return None
    return parse_program({key: value for key, value in recorded.items() if key != "digest"})


def parse_program(value: Any, where: str = "program") -> Program:
    """Check the form of a program; whether its triggers and changes exist is checked where they are built.

    Raises:
        ManifestError: It breaks the format.
    """
    program: _Program = checked(value, _Program, where, ManifestError)
    seen: set[str] = set()
    for i, arm in enumerate(program.arms):
        called = _check_arm(arm, f"{where}.arms[{i}]")
        if called in seen:
            raise ManifestError.seen(
                f"{where}.arms[{i}].name", called, " of two arms. Give each a name of its own."
            )
        seen.add(called)
    if any(_patterns(cases) for cases in (program.only, program.without)) and not program.because:
        raise ManifestError(f"{where} says which cases it fits, but not why. Add because, in words.")
    return Program(
        program.name,
        program.arms,
        program.about,
        _patterns(program.only),
        _patterns(program.without),
        program.because,
    )


def _patterns(cases: _Cases) -> dict[str, tuple[str, ...]]:
    return {key: patterns for key in cases.__struct_fields__ if (patterns := getattr(cases, key)) is not None}


def _check_arm(value: Json, where: str) -> str:
    """Return the name of an arm that is spelled as it must be."""
    arm: _Arm = checked(value, _Arm, where, ManifestError)
    name, schedule = arm.name, arm.schedule
    for taken, option in (
        (BASE_AGAIN, "noise=floor:PAIRS"),
        (SHAM, "noise=sham:SHARE"),
        (SHAM_DYNAMIC, "noise=sham:SHARE"),
    ):
        if name == taken:
            raise ManifestError.seen(
                f"{where}.name",
                name,
                f" is the arm that --libero-max-{option} adds. Use that option, or another name.",
            )
    for i, entry in enumerate(schedule):
        check_entry(entry, f"{where}.schedule[{i}]")
    if name in (BASE, DYNAMIC) and value.keys() & {"repetition", "cadence", "latency", "policy"}:
        raise ManifestError(
            f"{where}: {name!r} has a repetition, a cadence, a latency or a policy, but Base and Dynamic "
            "share their prefix. Give them to an arm of another name."
        )
    if "policy" in value and not schedule:
        raise ManifestError(
            f"{where}: arm {name!r} has policy={arm.policy!r} and an empty schedule, but another policy goes "
            "on from the first entry. Give it one, for example at_start with the change nothing."
        )
    if arm.at_once and "policy" not in value:
        raise ManifestError(
            f"{where}: arm {name!r} has at_once=true and no policy, but only another policy is asked at "
            "once. Give it a policy, or leave at_once out."
        )
    if (name == BASE and schedule) or (name == DYNAMIC and not schedule):
        what = "nothing happens in Base" if name == BASE else "something happens in Dynamic"
        raise ManifestError.seen(f"{where}.schedule", list(schedule), f" of arm {name!r}, but {what}.")
    horizon = arm.cadence.horizon or arm.cadence.query_interval
    if not 1 <= arm.cadence.query_interval <= horizon:
        raise ManifestError(
            f"{where}.cadence has query_interval={arm.cadence.query_interval} and horizon={horizon}, but "
            "1 <= Q <= H: a query returns at most H actions, of which Q are executed."
        )
    return name


def check_entry(value: Any, where: str) -> Json:
    """Return the entry of a schedule as an object of the right form, or raise ManifestError."""
    kind = _Reversal if isinstance(value, dict) and "reverts" in value else _Happening
    entry: Json = value
    checked(entry, kind, where, ManifestError)
    for key, inner in (("trigger", "type"), ("change", "operation")):
        if key in entry and entry[key] != EVENT:
            checked_value = checked(entry[key], Object, f"{where}.{key}", ManifestError).get(inner)
            checked(checked_value, Word, f"{where}.{key}.{inner}", ManifestError)
    return entry
