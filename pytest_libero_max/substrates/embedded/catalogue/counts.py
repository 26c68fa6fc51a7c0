"""The numbers of variations of each kind in LIBERO-Plus's registry, which the catalogue reproduces."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

_TABLES = tomllib.loads(Path(__file__).with_name("plus_counts.toml").read_text(encoding="utf-8"))

KINDS: tuple[str, ...] = tuple(_TABLES["kinds"])
"""The columns of :data:`VARIATIONS`."""

VARIATIONS: Mapping[str, list[list[int]]] = _TABLES["variations"]
"""Variations of each unmodified task by kind, in the suite's order of tasks."""

DIFFICULTY: Mapping[str, Mapping[str, list[int]]] = _TABLES["difficulty"]
"""Variations of difficulty 1 to 5, and of none, by category and suite. The order of the categories is that of
the registry."""
