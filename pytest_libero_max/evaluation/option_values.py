"""Values of options from their text.

Each function returns one, or raises ``ValueError``, or an error of this package, with the rule.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.cases import SUITE_BUDGETS
from pytest_libero_max.errors import ReportError, did_you_mean
from pytest_libero_max.evaluation.array_jobs import shard_of_job
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.runs.media import selection_named

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.latency import Latency
    from pytest_libero_max.benchmark.order import Order
    from pytest_libero_max.report.gates import Gate
    from pytest_libero_max.report.stopping_rule import NamedRule

RECORDED = "recorded:"
"""Begins the value of an option that is read from a run."""

LONGEST_S = 10_000_000
MOST_GIB = 1_000_000
MOST_PROCESSORS = 1_000


def text(value: str) -> str:
    """Anything that is not empty."""
    if not value.strip():
        raise ValueError("expected some text")
    return value


def positive(text: str) -> int:
    """Parse an integer of at least 1."""
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise ValueError("expected an integer of at least 1")
    return int(text)


def suites(text: str) -> tuple[str, ...]:
    """Parse names of LIBERO's suites, with commas between."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in SUITE_BUDGETS:
            raise ValueError(f"expected suites with commas between. {did_you_mean(name, SUITE_BUDGETS)}")
    return tuple(sorted({*names}))


def count(text: str) -> int:
    """Parse an integer of at least 0."""
    if not text.isascii() or not text.isdigit():
        raise ValueError("expected an integer of at least 0")
    return int(text)


def amount(text: str) -> float:
    """Parse a number of processors of some kind, which may be a fraction."""
    value = _number(text)
    if not 0 <= value <= MOST_PROCESSORS or (value > 1 and value != int(value)):
        raise ValueError("expected a number of at least 0, whole above 1")
    return value


def seconds(text: str) -> float:
    """Parse a duration, s."""
    duration = _number(text)
    if not 0 < duration <= LONGEST_S:
        raise ValueError(f"expected seconds, above 0 and at most {LONGEST_S}")
    return duration


def limits(text: str) -> Limits:
    """Parse time limits by what they are of, with commas between."""
    return Limits(**_named(text, ":", dict.fromkeys(("query", "step", "pair"), seconds)))


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
    address, *words = text(value).split(",")
    ship = "ship" in words
    named = ",".join(word for word in words if word != "ship")
    rest = _named(named, "=", {"actors": positive, "cpus": amount, "gpus": amount}) if named else {}
    parsed = Cluster(address, **rest, ship=ship)
    if parsed.actors is None and not parsed.cpus and not parsed.gpus:
        raise ValueError("with cpus=0 nothing says how many actors have room; add actors=N")
    return parsed


def study(text: str) -> str:
    """Check the name of a study, with settings behind a colon; a file is read later."""
    from pytest_libero_max.studies.registry import FILES, STUDIES

    if not text.endswith(FILES):
        known_in(STUDIES)(text.partition(":")[0])
    return text


def gibibytes(text: str) -> float | None:
    """Parse an amount of memory, GiB; 0 for ``none``, None for ``auto``."""
    if text == "auto":
        return None
    if text == "none":
        return 0.0
    amount = _number(text)
    if not 0 < amount <= MOST_GIB:
        raise ValueError("expected GiB as a number above 0, auto, or none")
    return amount


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


def fraction(text: str) -> float:
    """Parse a number from 0 to 1."""
    value = _number(text)
    if not 0.0 <= value <= 1.0:
        raise ValueError("expected a number from 0 to 1, for example 0.5")
    return value


def latency(text: str) -> Latency:
    """Parse the time that a query takes; ``recorded:RUN`` reads it from the records of a run."""
    from pytest_libero_max.benchmark.latency import Latency
    from pytest_libero_max.worlds.contract import CONTROL_HZ

    if not text.startswith(RECORDED):
        return Latency.parse(text, CONTROL_HZ)
    from pytest_libero_max.runs.query_times import recorded_latency

    folder = text.removeprefix(RECORDED)
    waits = folder.endswith(",sync")
    try:
        return recorded_latency(Path(folder.removesuffix(",sync")).expanduser(), "sync" if waits else "async")
    except ReportError as error:
        raise ValueError(f"expected the folder of a run behind {RECORDED!r}; {error}") from None


def order(text: str) -> Order:
    """Parse an order of play."""
    from pytest_libero_max.benchmark.order import Order

    return Order.parse(text)


def stopping_rule(text: str) -> NamedRule:
    """Parse a stopping rule with its arguments."""
    from pytest_libero_max.report.stopping_rule import parse_rule

    return parse_rule(text)


def gate(text: str) -> Gate:
    """Parse a condition on the report."""
    from pytest_libero_max.report.gates import parse_gate

    return parse_gate(text)


def known_in(known: Collection[str]) -> Callable[[str], str]:
    """Return a parser that accepts a name of a collection, which is not read before."""

    def parse(text: str) -> str:
        if text not in known:
            raise ValueError(f"unknown value. {did_you_mean(text, known)}")
        return text

    return parse


def selection_in(known: Collection[str]) -> Callable[[str], str]:
    """Return a parser of the name of a selection of pairs, in either number of *regression*."""
    parse = known_in(known)
    return lambda text: parse(selection_named(text))


def _named(text: str, mark: str, parsers: Mapping[str, Callable[[str], Any]]) -> dict[str, Any]:
    """Parse values by name, with commas between."""
    values: dict[str, Any] = {}
    for part in text.split(","):
        name, found, value = part.partition(mark)
        if name not in parsers or not found or name in values:
            form = f"NAME{mark}VALUE"
            raise ValueError(f"{part!r}: expected {form}, each name once. {did_you_mean(name, parsers)}")
        try:
            values[name] = parsers[name](value)
        except ValueError as error:
            raise ValueError(f"{part!r}: {error}") from None
    return values


def _number(text: str) -> float:
    """Parse a number; NaN, which breaks every rule, where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
