"""Values as pytest's ini file holds them: text, or the types of the TOML tables that pytest 9 reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from pytest_libero_max.runs.setting import Option


def in_file(config: pytest.Config) -> Mapping[str, Any]:
    """Return the entries of the ini file and of ``-o``, by key."""
    entries: Mapping[str, Any] = (
        config._inicfg if hasattr(config, "_inicfg") else config.inicfg
    )  # until pytest 9
    return entries


def native_value(option: Option, value: object) -> Any:
    """Return a value of a TOML table as another ini file writes it: text, a list of texts, True or False.

    pytest reads there only the one type that is declared, and a limit, a share or a shard is a number in one
    project and text in the next. Where an option's text has parts, a list is several of them.

    Returns:
        None for an empty list.

    Raises:
        pytest.UsageError: It has a type that the option does not have.
    """
    if option.switch:
        if not isinstance(value, bool):
            raise _unexpected(option, value, "true or false")
        return value
    if option.many:
        values = value if isinstance(value, list) else [value]
        lines = [line.strip() for entry in values for line in _single(option, entry).splitlines()]
        return [line for line in lines if line]
    if option.has_parts and isinstance(value, list):
        return ",".join(_single(option, entry) for entry in value) or None
    return _single(option, value)


def _single(option: Option, value: object) -> str:
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        one = "text or a number"
        expected = f"{one}, or a list of these" if option.many else one
        if option.has_parts:
            expected = f"{one}, or a list of these, as in {option.metavar}"
        raise _unexpected(option, value, expected)
    return str(value)


def _unexpected(option: Option, value: object, expected: str) -> pytest.UsageError:
    return pytest.UsageError(f"ini option {option.key}={value!r}: expected {expected}")
