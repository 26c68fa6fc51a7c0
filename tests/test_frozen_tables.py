"""No table that reaches a result can be edited by a policy that shares the process."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from importlib import import_module
from pkgutil import walk_packages
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
import pytest

ROOMS = (
    *("benchmark", "tasks", "changes", "events", "substrates", "worlds", "pairing", "policies", "experts"),
    "studies",
)

_TABLE = re.compile(r"_?[A-Z][A-Z0-9_]*")


def modules(room: str) -> Iterator[ModuleType]:
    with warnings.catch_warnings():  # of packages of others, which are imported for the first time
        warnings.simplefilter("ignore")
        package = import_module(f"pytest_libero_max.{room}")
        yield package
        for found in walk_packages(package.__path__, f"{package.__name__}."):
            yield import_module(found.name)


def editable(value: Any, depth: int = 2) -> bool:
    """Return True if a table, or a table in it, can be edited."""
    if isinstance(value, dict | list | set | bytearray):
        return True
    if isinstance(value, np.ndarray):
        return bool(value.flags.writeable)
    inner = value.values() if isinstance(value, MappingProxyType) else value
    return (
        bool(depth)
        and isinstance(inner, tuple | type({}.values()))
        and any(editable(part, depth - 1) for part in inner)
    )


@pytest.mark.parametrize("room", ROOMS)
def test_the_tables_of_a_room_are_frozen(room: str) -> None:
    found = [
        f"{module.__name__}.{name}"
        for module in modules(room)
        for name, value in vars(module).items()
        if _TABLE.fullmatch(name) and editable(value)
    ]
    assert found == []
