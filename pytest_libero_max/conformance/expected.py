"""A file of rules that a subject is expected to break, each with a reason."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.errors import OptionError

_EXAMPLE = '["policy/images/rotated"]\nreason = "trained on images as delivered"\nlink = "https://..."'


@dataclass(frozen=True)
class Expected:
    """Why a rule is expected to be broken."""

    reason: str
    link: str = ""

    def __str__(self) -> str:
        return f"{self.reason} ({self.link})" if self.link else self.reason


def read_expected(path: Path) -> Mapping[str, Expected]:
    """Read a TOML file with a table for each rule, by its id.

    Raises:
        OptionError: It cannot be read, or has something else in it.
    """
    try:
        tables = tomllib.loads(read_text(path))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise OptionError(
            f"xfails={str(path)!r} cannot be read: {error}. Write a TOML file:\n{_EXAMPLE}"
        ) from None
    return {id: _entry(path, id, table) for id, table in tables.items()}


def _entry(path: Path, id: str, table: object) -> Expected:
    texts = isinstance(table, dict) and all(isinstance(value, str) for value in table.values())
    if not texts or not table.get("reason") or table.keys() - {"reason", "link"}:  # type: ignore[attr-defined]
        raise OptionError(
            f"xfails={str(path)!r} has {id!r} = {table!r}, but each rule has a reason and may have a link, "
            f"texts both. For example:\n{_EXAMPLE}"
        )
    return Expected(**table)  # type: ignore[arg-type]
