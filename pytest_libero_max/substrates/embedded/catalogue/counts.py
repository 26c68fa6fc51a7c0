"""The numbers of variations of each kind in LIBERO-Plus's registry, which the catalogue reproduces."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pytest_libero_max.benchmark.documents import read_text


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(read_text(Path(__file__).with_name("plus_counts.toml")))


def _frozen(rows: Mapping[str, list[int]]) -> Mapping[str, tuple[int, ...]]:
    return MappingProxyType({name: tuple(row) for name, row in rows.items()})


KINDS: tuple[str, ...] = tuple(_tables()["kinds"])
"""The columns of :data:`VARIATIONS`."""

VARIATIONS: Mapping[str, tuple[tuple[int, ...], ...]] = MappingProxyType(
    {suite: tuple(map(tuple, rows)) for suite, rows in _tables()["variations"].items()}
)
"""Variations of each unmodified task by kind, in the suite's order of tasks."""

DIFFICULTY: Mapping[str, Mapping[str, tuple[int, ...]]] = MappingProxyType(
    {category: _frozen(suites) for category, suites in _tables()["difficulty"].items()}
)
"""Variations of difficulty 1 to 5, and of none, by category and suite. The order of the categories is that of
the registry."""
