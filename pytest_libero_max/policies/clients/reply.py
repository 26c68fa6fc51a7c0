"""Conversion of a server's reply to actions, by a profile."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_libero_max.errors import AdapterError, ServerError, counted
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
from pytest_libero_max.policies.profile import Profile
from pytest_libero_max.policies.transforms.actions import Statistics, read_statistics, unnormalise
from pytest_libero_max.policies.transforms.steps import ACTION_STEPS, parse_steps


class Reply:
    """Conversion of a server's reply to actions.

    Attributes:
        returned: Number of actions in the last reply that was read, before the cut.

    Raises:
        AdapterError: A step does not exist, or the statistics cannot be read.
    """

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
