"""Values as pytest's ini file holds them: text, or the types of the TOML tables that pytest 9 reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest


def in_file(config: pytest.Config) -> Mapping[str, Any]:
    """Return the entries of the ini file and of ``-o``, by key."""
    entries: Mapping[str, Any] = (
        config._inicfg if hasattr(config, "_inicfg") else config.inicfg
    )  # until pytest 9
    return entries


def native_value(key: str, value: object, *, many: bool, switch: bool) -> Any:
    """Return a value of a TOML table as another ini file writes it: text, a list of texts, True or False.

    pytest reads there only the one type that is declared, and a limit, a share or a shard is a number in one
    project and text in the next.

    Raises:
        pytest.UsageError: It has a type that the option does not have.
    """
    values = value if many and isinstance(value, list) else [value]
    kinds = (bool,) if switch else (str, int, float)
    expected = "true or false" if switch else "text or a number"
    for entry in values:
        if not isinstance(entry, kinds) or isinstance(entry, bool) != switch:
            choice = f"{expected}, or a list of these" if many else expected
            raise pytest.UsageError(f"ini option {key}={entry!r}: expected {choice}")
    if not many:
        return value if switch else str(value)
    texts = [line.strip() for entry in values for line in str(entry).splitlines()]
    return [text for text in texts if text]
