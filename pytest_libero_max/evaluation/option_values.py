"""Values of options from their text that need more than their text: :mod:`.text_values` has the others."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.text_values import amount, known_in, named_values, positive, seconds, text
from pytest_libero_max.evaluation.array_jobs import shard_of_job
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.runs.media import SELECTIONS, selection_named

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import Gate
    from pytest_libero_max.report.stopping_rule import NamedRule


def limits(text: str) -> Limits:
    """Parse time limits by what they are of, with commas between."""
    return Limits(**named_values(text, ":", dict.fromkeys(("query", "step", "pair"), seconds)))


@dataclass(frozen=True)
class Cluster:
    """A Ray cluster that plays pairs."""

    address: str
    """Its address; ``auto`` for the one that this machine belongs to."""
    actors: int | None = None
    """Number of actors that play at once; None for as many as have room."""
    cpus: float = 1.0
    """CPUs that each takes."""
    gpus: float = 0.0
    """GPUs that each takes."""
    ship: bool = False
    """True if the working folder is sent to its nodes."""


def cluster(value: str) -> Cluster:
    """Parse the address of a Ray cluster with what its actors take."""
    address, *words = map(str.strip, value.split(","))
    ship = "ship" in words
    named = ",".join(word for word in words if word != "ship")
    rest = named_values(named, "=", {"actors": positive, "cpus": amount, "gpus": amount}) if named else {}
    parsed = Cluster(text(address), **rest, ship=ship)
    if parsed.actors is None and not parsed.cpus and not parsed.gpus:
        raise ValueError("with cpus=0 nothing says how many actors have room; add actors=N")
    return parsed


@dataclass(frozen=True)
class Films:
    """Pairs to film."""

    which: str
    """Name of a selection of pairs."""
    most: int | None = None
    """Most regressions and most gains; None for the usual number."""

    def __str__(self) -> str:
        return self.which if self.most is None else f"{self.which}:{self.most}"


def films(text: str) -> Films:
    """Parse a selection of pairs to film, with the most of them behind a colon."""
    which, colon, most = text.partition(":")
    return Films(selection_in(SELECTIONS)(which), positive(most) if colon else None)


def shard(text: str) -> tuple[int, int]:
    """Parse the number and count of a part, both from 1."""
    if text == "env":
        return shard_of_job(os.environ)
    index, slash, count = text.partition("/")
    if not (slash and index.isascii() and index.isdigit() and count.isascii() and count.isdigit()):
        raise ValueError("expected I/N, for example 1/4, or env")
    if not 1 <= int(index) <= int(count):
        raise ValueError("expected I/N with 1 <= I <= N")
    return int(index), int(count)


def stopping_rule(text: str) -> NamedRule:
    """Parse a stopping rule with its arguments."""
    from pytest_libero_max.report.stopping_rule import parse_rule

    return parse_rule(text)


def gate(text: str) -> Gate:
    """Parse a condition on the report."""
    from pytest_libero_max.report.gates import parse_gate

    return parse_gate(text)


def selection_in(known: Collection[str]) -> Callable[[str], str]:
    """Return a parser of the name of a selection of pairs, in either number of *regression*."""
    parse = known_in(known)
    return lambda text: parse(selection_named(text))
