"""Contents of a task's BDDL file: its typed names, its initial facts and its goal."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pytest_libero_max.errors import SubstrateError

Words = tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """A task description. All names are in lower case, as the environments read them."""

    objects: Mapping[str, str]
    """Category of each movable instance."""
    fixtures: Mapping[str, str]
    """Category of each other instance; tables and floors are among them."""
    interest: tuple[str, ...]
    """Names that the file marks as of interest; may be regions."""
    initial: tuple[Words, ...]
    """Facts at the start, a predicate and its arguments each, in order."""
    goal: tuple[Words, ...]
    """Facts that must hold at the end, likewise."""


def describe(text: str) -> Description:
    """Read a BDDL text.

    Raises:
        SubstrateError: It is not BDDL, or lacks a section.
    """
    try:
        groups = importlib.import_module("bddl.parsing").scan_tokens(string=text)
        sections = {group[0]: group[1:] for group in groups if isinstance(group, list) and group}
        return Description(
            objects=dict(_typed(sections[":objects"])),
            fixtures=dict(_typed(sections[":fixtures"])),
            interest=tuple(sections[":obj_of_interest"]),
            initial=tuple(_facts(sections[":init"])),
            goal=tuple(_facts(sections[":goal"])),
        )
    except Exception as error:  # the parser raises whatever it likes
        what = f"{type(error).__name__}: {error}"
        raise SubstrateError(f"A task description cannot be read: {what}.") from error


def _typed(words: list[Any]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of name and kind in ``a b - kind c - other``."""
    names: list[str] = []
    kinds = iter(words)
    for word in kinds:
        if word == "-":
            kind = next(kinds)
            yield from ((name, kind) for name in names)
            names = []
        else:
            names.append(word)


def _facts(groups: list[Any]) -> Iterator[Words]:
    """Every innermost group, in order."""
    for group in groups:
        if not isinstance(group, list):
            continue
        if any(isinstance(part, list) for part in group):
            yield from _facts(group)
        elif group:
            yield tuple(group)
