"""Contract of a probe, and the calls of several probes in a rollout."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral, Real
from typing import Any, ClassVar, Generic, Literal, TypeVar

import numpy as np

from pytest_libero_max.benchmark.structs import LARGEST, shown
from pytest_libero_max.errors import ProbeError, counted
from pytest_libero_max.pairing.trajectory import Trajectory
from pytest_libero_max.worlds.contract import Control, World

Scalar = bool | int | float | str | None
Value = Scalar | list[Scalar]
"""Value of a column: a JSON scalar or a list of them."""

State = TypeVar("State")
T = TypeVar("T")

_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Column:
    """One value that a probe yields of an arm."""

    name: str
    """Lower-case letters, digits and underscores."""
    type: Literal["bool", "int", "float", "str"]
    """Of the value, or of each of many."""
    meaning: str
    """A noun phrase."""
    unit: str | None = None
    """For example ``m``; None for no unit."""
    many: bool = False
    """True for a list."""
    optional: bool = False
    """True if it, or one of many, may be None."""
    least: float | None = None
    """Smallest number that it may be; None for no bound."""
    along: str | None = None
    """Name of another column of many, to whose values these belong one by one; None for none."""

    def checked(self, value: object) -> Value:
        """Return a value as JSON types.

        Raises:
            ValueError: It is not of the column's type, or a number out of bounds.
        """
        if not self.many:
            return self._scalar(value)
        if isinstance(value, str) or not isinstance(value, Sequence | np.ndarray):
            raise ValueError(f"{self.name}={value!r}, but must be a list of {self.type}")
        return [self._scalar(item) for item in value]

    def _scalar(self, value: object) -> Scalar:
        if value is None and self.optional:
            return None
        if self.type == "bool" and isinstance(value, bool | np.bool_):
            return bool(value)
        if self.type == "str" and isinstance(value, str):
            return str(value)
        least: Any = -LARGEST if self.least is None else self.least
        if not isinstance(value, bool | np.bool_) and isinstance(value, Real) and least <= value <= LARGEST:
            if self.type == "int" and isinstance(value, Integral):
                return int(value)
            if self.type == "float":
                return float(value)
        kind = (
            f"{'finite, a ' if self.type == 'float' else ''}{self.type}{' or None' if self.optional else ''}"
        )
        bound = "" if self.least is None else f", at least {self.least:g}"
        raise ValueError(f"{self.name}={shown(value)}, but must be {kind}{bound}")


def require_lists(schema: Iterable[Column], values: Mapping[str, Any]) -> None:
    """Check that columns whose values belong together have as many of them.

    Raises:
        ValueError: They have not.
    """
    for column in schema:
        if column.along is not None and len(values[column.name]) != len(values[column.along]):
            raise ValueError(
                f"{column.name} has {counted(len(values[column.name]), 'value')}, but must have one for "
                f"each of the {len(values[column.along])} of {column.along}"
            )


@dataclass(frozen=True, slots=True)
class View:
    """An arm as a probe sees it, read only: right after a step or a query, or at its end."""

    world: World
    """The world now."""
    trajectory: Trajectory
    """All that has happened, with the actions that are queued (``trajectory.pending``)."""
    entity: str
    """Name of the case's trigger entity."""
    budget: int
    """Policy steps that the episode may take."""
    control: Control
    """Meaning of the actions."""


class Probe(ABC, Generic[State]):
    """Reads something of an arm while it is played: a pure fold over its steps or queries.

    The state is an immutable value (hashable: numbers, strings, tuples of them, frozen dataclasses), so that
    the arms that part at an event go on from the same one. What happens in a replay of the executed prefix
    has been seen already and is not shown again. No answer may depend on anything but the arguments.
    """

    name: ClassVar[str]
    """Name in the record and on the command line: lower-case letters, digits and underscores."""
    schema: ClassVar[tuple[Column, ...]]
    """The columns that it yields."""
    cost: ClassVar[str]
    """Its cost in words, for the table of probes."""
    every: ClassVar[Literal["step", "query", "end"]] = "step"
    """Times at which :meth:`step` is called: after every policy ``step``, after every ``query``, or never,
    for a probe that reads all that it needs at the ``end``."""

    def start(self, view: View) -> State:
        """Return the state before the first step."""
        return None  # type: ignore[return-value]  # the state of a probe that has none

    def step(self, state: State, view: View) -> State:
        """Return the state after one more step or query."""
        return state

    @abstractmethod
    def columns(self, state: State, view: View) -> Mapping[str, Any]:
        """Return the value of each column, by name, at the end of an arm."""


def check_probe(name: str, value: object) -> Probe[Any]:
    """Return a probe if a class, or an object, is one of that name.

    Raises:
        ValueError: It is none; says which rule it breaks.
    """
    if not (isinstance(value, type) and issubclass(value, Probe)):
        raise ValueError(f"{value!r} is no subclass of Probe")
    missing = [field for field in ("name", "schema", "cost") if not hasattr(value, field)]
    if missing:
        raise ValueError(f"it does not declare {missing[0]!r}")
    if value.name != name or not _NAME.fullmatch(name):
        raise ValueError(
            f"its name is {value.name!r}, but must be {name!r}, in lower-case letters, digits and underscores"
        )
    columns = [column.name for column in value.schema]
    if not columns or len(set(columns)) != len(columns):
        raise ValueError(f"its columns are {columns}, but must be at least one, each name once")
    lists = {column.name for column in value.schema if column.many}
    for column in value.schema:
        if column.along is not None and not {column.name, column.along} <= lists:
            raise ValueError(
                f"{column.name} is declared along {column.along!r}, but both must be columns of many values"
            )
    if value.every not in ("step", "query", "end"):
        raise ValueError(f"every={value.every!r}, but must be 'step', 'query' or 'end'")
    return value()


@dataclass(frozen=True)
class Probes:
    """Probes that watch a rollout together.

    Each is checked to leave the world as it is, by the world's digest: those of every pair at the end of an
    arm, and those that were asked for right after each call.
    """

    standard: tuple[Probe[Any], ...] = ()
    """Those of every pair."""
    added: tuple[Probe[Any], ...] = ()
    """Those that were asked for."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of those that were asked for."""
        return tuple(probe.name for probe in self.added)

    @cached_property
    def _all(self) -> tuple[Probe[Any], ...]:
        return (*self.standard, *self.added)

    @cached_property
    def on_steps(self) -> bool:
        """True if one is asked after every step."""
        return any(probe.every == "step" for probe in self._all)

    @cached_property
    def on_queries(self) -> bool:
        """True if one is asked after every query."""
        return any(probe.every == "query" for probe in self._all)

    def start(self, view: View) -> tuple[object, ...]:
        """Return the state of each before the first step.

        Raises:
            ProbeError: One raised, altered the world, or has a state that is no immutable value.
        """
        states = tuple(
            _asked(probe, "start", view, lambda probe=probe: probe.start(view))  # type: ignore[misc]
            for probe in self._all
        )
        self.require_values(states)
        return states

    def after(self, what: Literal["step", "query"], view: View) -> tuple[object, ...]:
        """Return the state of each after one more step or query.

        Raises:
            ProbeError: One raised, or altered the world.
        """
        where = f"{what} {view.trajectory.step if what == 'step' else len(view.trajectory.queries) - 1}"
        return tuple(
            state
            if probe.every != what
            else probe.step(state, view)
            if number < len(self.standard)
            else _asked(probe, where, view, lambda probe=probe, state=state: probe.step(state, view))  # type: ignore[misc]
            for number, (probe, state) in enumerate(zip(self._all, view.trajectory.seen, strict=True))
        )

    def require_values(self, states: tuple[object, ...]) -> None:
        """Check that arms can share the states of the probes.

        Raises:
            ProbeError: One is no immutable value.
        """
        for probe, state in zip(self._all, states, strict=True):
            try:
                hash(state)
            except TypeError as error:
                raise ProbeError(
                    f"probe {probe.name!r} has a state of type {type(state).__name__} ({error}), but arms go "
                    "on from one state: use numbers, strings, tuples of them, or a frozen dataclass."
                ) from error

    def columns(self, view: View) -> dict[str, dict[str, Value]]:
        """Return the columns of each at the end of an arm, by name.

        Raises:
            ProbeError: One raised, altered the world, or yields something else than it declares.
        """
        found = {}
        for probe, state in zip(self._all, view.trajectory.seen, strict=True):
            values = _asked(probe, "columns", view, lambda: probe.columns(state, view))  # noqa: B023  # called at once
            declared = {column.name for column in probe.schema}
            if set(values) != declared:
                raise ProbeError(
                    f"probe {probe.name!r} yields the columns {sorted(values)}, but declares "
                    f"{sorted(declared)}. Change its schema or what columns() returns."
                )
            try:
                found[probe.name] = {
                    column.name: column.checked(values[column.name]) for column in probe.schema
                }
                require_lists(probe.schema, found[probe.name])
            except ValueError as error:
                raise ProbeError(f"probe {probe.name!r}: {error}. Repair its schema or columns().") from error
        return found


def _asked(probe: Probe[Any], where: str, view: View, call: Callable[[], T]) -> T:
    """Return the answer of a probe.

    Raises:
        ProbeError: It raised, or altered the world.
    """
    try:
        answer = call()
    except Exception as error:
        raise ProbeError(
            f"probe {probe.name!r} raised {type(error).__name__} in {where}: {error}. Repair it, or play "
            "without it."
        ) from error
    if view.world.digest() != view.trajectory.digest:
        raise ProbeError(
            f"probe {probe.name!r} altered the world in {where}, but a world is read only for it: the arm "
            "would not be the one without the probe. Let it read, or work on a copy of model and data."
        )
    return answer
