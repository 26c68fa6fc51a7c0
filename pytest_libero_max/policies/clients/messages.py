"""Conversion of an observation to a request, and of a server's reply to actions, by a profile."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, ServerError, counted, did_you_mean
from pytest_libero_max.policies.answers import (
    Unplayable,
    is_array,
    likely_key,
    read_numbers,
    read_rows,
)
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.codecs import NPY_MAGIC, npy_array
from pytest_libero_max.policies.clients.transport import reported
from pytest_libero_max.policies.contract import Episode, Query, published_seed
from pytest_libero_max.policies.profile import Profile
from pytest_libero_max.policies.transforms.actions import Statistics, read_statistics, unnormalise
from pytest_libero_max.policies.transforms.images import side_by_side
from pytest_libero_max.policies.transforms.steps import (
    ACTION_STEPS,
    INPUT_STEPS,
    TEXT_STEPS,
    Step,
    parse_steps,
)
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import Robot


@dataclass(frozen=True)
class Input:
    """One array, text or file that a request holds."""

    source: str | None
    """A key of the observation, or None."""
    parts: tuple[str, ...]
    """Other inputs, joined: values one after the other, images side by side."""
    steps: tuple[Step, ...]
    dtype: str | None
    """Its type, or None to leave it."""
    shape: tuple[int, ...] | None
    """Its shape, or None to leave it."""


class Request:
    """Conversion of an observation to a request."""

    def __init__(self, profile: Profile) -> None:
        self._robot = profile.robot
        tables = profile.tables.get("inputs", {}).items()
        self._inputs = {name: _input(name, table, self._robot) for name, table in tables}
        self._text = parse_steps(profile.get("instruction", "steps", []), TEXT_STEPS, "instruction.steps")
        self._layout = profile.tables.get("request", {})
        self._where = f"profile {profile.name!r}"
        known = (*self._inputs, *_QUERY_VALUES)
        for name in _named(self._layout):
            if name not in known:
                raise AdapterError(f"{self._where}: request names ${name}. {did_you_mean(name, known)}")
        for name, item in self._inputs.items():
            for part in item.parts:
                if part not in self._inputs:
                    raise AdapterError(
                        f"{self._where}: inputs.{name} joins {part!r}. {did_you_mean(part, self._inputs)}"
                    )
        self.cameras = self.cameras_of(self._layout)

    def cameras_of(self, layout: Any) -> tuple[str, ...]:
        """Return the cameras whose images a layout needs."""
        needed = {source for name in _named(layout) for source in self._sources(name)}
        return tuple(camera for camera in self._robot.cameras if f"{camera}_image" in needed)

    def build(
        self, observation: Observation, query: Query, episode: Episode, layout: Any = None
    ) -> dict[str, Any]:
        """Return the request of a query."""
        values = {name: value_of(query, episode) for name, value_of in _QUERY_VALUES.items()}
        values["instruction"] = self.instruction(values["instruction"])
        layout = self._layout if layout is None else layout
        for name in set(_named(layout)) - values.keys():
            values[name] = self._value(name, observation)
        filled: dict[str, Any] = _fill(layout, values)
        return filled

    def arrays(self, observation: Observation, layout: Any = None) -> dict[str, NDArray[Any]]:
        """Return the inputs of a request that are arrays, by name."""
        named = dict.fromkeys(_named(self._layout if layout is None else layout))
        values = {name: self._value(name, observation) for name in named if name in self._inputs}
        return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}

    def visible(self, observation: Observation) -> dict[str, NDArray[Any]]:
        """Return the arrays of a request, by name, that can be made of an observation without all cameras."""
        inputs = [name for name in dict.fromkeys(_named(self._layout)) if name in self._inputs]
        there = [f"${name}" for name in inputs if self._sources(name) <= observation.keys()]
        return self.arrays(observation, there)

    def instruction(self, words: str) -> str:
        """Return the instruction for the server."""
        for step in self._text:
            words = step(words)
        return words

    def _sources(self, name: str) -> set[str]:
        item = self._inputs.get(name)
        if item is None:
            return set()
        own = set() if item.source is None else {item.source}
        return own.union(*(self._sources(part) for part in item.parts if part != name))

    def _value(self, name: str, observation: Observation) -> Any:
        item = self._inputs[name]
        if item.source is not None:
            value: Any = np.array(observation[item.source])
        else:
            value = _joined([self._value(part, observation) for part in item.parts])
        try:
            for step in item.steps:
                value = step(value)
        except AdapterError as error:
            raise error.within(f"{self._where}, inputs.{name}", field=f"inputs.{name}") from None
        try:
            value = value if item.dtype is None else value.astype(item.dtype)
            return value if item.shape is None else value.reshape(item.shape)
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            raise AdapterError(
                f"{self._where}, inputs.{name}: dtype={item.dtype!r} and shape={item.shape!r} do not fit "
                f"{getattr(value, 'shape', type(value).__name__)}: {error}."
            ) from error


_QUERY_VALUES: Mapping[str, Callable[[Query, Episode], Any]] = MappingProxyType(
    {
        "instruction": lambda query, episode: query.instruction,
        "seed": lambda query, episode: query.seed,
        "published_seed": lambda query, episode: published_seed(episode.seed, query),
        "index": lambda query, episode: query.index,
        "step": lambda query, episode: query.step,
        "suite": lambda query, episode: episode.suite,
        "task_index": lambda query, episode: episode.task_index,
        "episode_instruction": lambda query, episode: episode.instruction,
        "policy_seed": lambda query, episode: episode.seed,
        "max_steps": lambda query, episode: episode.max_steps,
    }
)
"""Names that a request can use besides the inputs of its profile."""


def _input(name: str, table: Any, robot: Robot) -> Input:
    where = f"inputs.{name}"
    known = ("from", "join", "steps", "dtype", "shape")
    if not isinstance(table, dict) or ("from" in table) == ("join" in table):
        raise AdapterError.seen(where, table, ", but must be a table with either 'from' or 'join'.")
    for field in table:
        if field not in known:
            raise AdapterError(f"{where}.{field} is unknown. {did_you_mean(field, known)}")
    sources = (*(f"{camera}_image" for camera in robot.cameras), *robot.state)
    source = table.get("from")
    if source is not None and source not in sources:
        raise AdapterError.seen(f"{where}.from", source, f". {did_you_mean(str(source), sources)}")
    steps = parse_steps(table.get("steps", []), INPUT_STEPS, f"{where}.steps")
    shape = table.get("shape")
    return Input(
        source,
        tuple(table.get("join", ())),
        steps,
        table.get("dtype"),
        None if shape is None else tuple(shape),
    )


def _named(layout: Any) -> list[str]:
    """Return the names that a layout refers to with a dollar, in order."""
    if isinstance(layout, Mapping):
        return [name for value in layout.values() for name in _named(value)]
    if isinstance(layout, list):
        return [name for value in layout for name in _named(value)]
    return [layout[1:]] if isinstance(layout, str) and layout[:1] == "$" else []


def _fill(layout: Any, values: Mapping[str, Any]) -> Any:
    if isinstance(layout, Mapping):
        return {key: _fill(value, values) for key, value in layout.items()}
    if isinstance(layout, list):
        return [_fill(value, values) for value in layout]
    if isinstance(layout, str) and layout[:1] == "$":
        return values[layout[1:]]
    return layout


def _joined(values: list[Any]) -> Any:
    if values[0].ndim == 3:
        return side_by_side(*values)
    return np.concatenate(values)


class Reply:
    """Conversion of a server's reply to actions."""

    def __init__(self, profile: Profile) -> None:
        self.returned: int | None = None
        self._components = profile.robot.components
        self._at = tuple(profile.get("reply", "at", []))
        self._parts = tuple(profile.get("reply", "parts", []))
        normalised = profile.get("reply", "normalised_at")
        self._normalised_at = None if normalised is None else tuple(normalised)
        self._steps = parse_steps(profile.get("actions", "steps", []), ACTION_STEPS, "actions.steps")
        self._before = parse_steps(
            profile.get("actions", "normalised_steps", []), ACTION_STEPS, "actions.normalised_steps"
        )
        file = profile.get("actions", "statistics")
        self._statistics: Statistics | None = None
        if file is not None:
            rule = profile.get("actions", "statistics_rule", "bounds")
            self._statistics = read_statistics(
                profile.folder / file, profile.get("actions", "statistics_key"), rule
            )

    def read(self, reply: Any, least: int, most: int) -> Actions:
        """Return the actions of a reply, (n, 7) float64, with ``least`` <= n <= ``most``.

        More than ``most`` are cut to the first ones, which are the next to be executed.
        """
        raw, normalised = self._find(reply)
        try:
            actions = read_rows(raw)
        except Unplayable as error:
            raise self._unplayable(error) from error
        try:
            if normalised:
                actions = self._unnormalised(actions)
            for step in self._steps:
                actions = step(actions)
        except AdapterError as error:
            raise ServerError(f"the reply has actions of shape {actions.shape}: {error}") from error
        if actions.ndim != 2 or actions.shape[1] != self._components:
            raise ServerError(
                f"the reply has actions of shape {actions.shape}, but must have (n, {self._components})"
            )
        if len(actions) < least:
            raise ServerError(
                f"the reply has {counted(len(actions), 'action')}, but Q={least} are executed before the "
                "next query; lower --libero-max-query-interval"
            )
        self.returned = len(actions)
        return actions[:most]

    def _find(self, reply: Any) -> tuple[Any, bool]:
        try:
            value = _at(reply, self._at)
        except KeyError as error:
            if self._normalised_at is None:
                raise _missing(reply, self._at, error) from None
            try:
                return _as_array(_at(reply, self._normalised_at)), True
            except KeyError:
                raise _missing(reply, self._at, error) from None
        if self._parts:
            if not isinstance(value, Mapping) or any(part not in value for part in self._parts):
                raise _missing(value, self._parts, None)
            try:
                value = _columns([read_numbers(_as_array(value[part])) for part in self._parts])
            except Unplayable as error:
                raise self._unplayable(error) from error
        return _as_array(value), False

    def _unplayable(self, error: Unplayable) -> ServerError:
        hint = "" if error.key is None else _hint((*self._at, error.key))
        rule = error.rule or "the actions must be numbers, (n, d)"
        return ServerError(f"the reply has {error.what}, but {rule}{hint}")

    def _unnormalised(self, actions: Actions) -> Actions:
        if self._statistics is None:
            raise ServerError(
                "the actions of the reply are normalised, and the profile names no statistics; extend it and "
                "give actions.statistics, the path of the dataset_statistics.json of these weights"
            )
        for step in self._before:
            actions = step(actions)
        return unnormalise(actions, self._statistics)


def _at(value: Any, path: tuple[str, ...]) -> Any:
    for key in path:
        if not isinstance(value, Mapping) or key not in value:
            raise KeyError(key)
        value = value[key]
    return value


def _missing(value: Any, path: tuple[str, ...], error: KeyError | None) -> ServerError:
    """Return the error of a reply without the actions; that of the server where the reply holds one."""
    if isinstance(value, Mapping) and "error" in value:
        return reported(value["error"])
    what = "/".join(path) if error is None else f"{'/'.join(path)} (no {error.args[0]!r})"
    if isinstance(value, Mapping):
        keys, key = f"the keys {sorted(map(str, value))}", likely_key(value)
        hint = "" if key is None else _hint((key,))
    else:
        keys, hint = f"a {type(value).__name__}", _hint(()) if is_array(value) else ""
    return ServerError(f"the reply has {keys}, but the profile takes the actions from {what}{hint}")


def _hint(path: tuple[str, ...]) -> str:
    """Return the field of a profile that takes the actions from somewhere else."""
    keys = ", ".join(f'"{key}"' for key in path)
    return f"; they seem to lie there: extend the profile with reply.at = [{keys}]"


def _as_array(value: Any) -> Any:
    """Return the array of a NumPy file; any other value as it is."""
    return npy_array(value) if isinstance(value, bytes) and value.startswith(NPY_MAGIC) else value


def _columns(parts: list[Actions]) -> Actions:
    """One array of several that hold a column or two each: (B, n, k) or (B, n) or (n,)."""
    columns = [
        part[0]
        if part.ndim == 3 and len(part) == 1
        else part.T
        if part.ndim == 2 and len(part) == 1
        else part
        for part in parts
    ]
    columns = [part.reshape(-1, 1) if part.ndim == 1 else part for part in columns]
    if any(part.ndim != 2 or len(part) != len(columns[0]) for part in columns):
        raise ServerError(
            f"the parts of the actions have shapes {', '.join(str(part.shape) for part in parts)}"
        )
    return np.concatenate(columns, axis=1)
