"""Values of options from their text.

Each function returns one, or raises ``ValueError``, or an error of this package, with the rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import did_you_mean
from pytest_libero_max.registry import Registry

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
    """Parse names of suites, with commas between."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in SUITES:
            raise ValueError(f"expected suites with commas between. {SUITES.none_called(name)}")
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


def fraction(text: str) -> float:
    """Parse a number from 0 to 1."""
    value = _number(text)
    if not 0.0 <= value <= 1.0:
        raise ValueError("expected a number from 0 to 1, for example 0.5")
    return value


def order(text: str) -> Order:
    """Parse an order of play."""
    return Order.parse(text)


def known_in(known: Collection[str]) -> Callable[[str], str]:
    """Return a parser that accepts a name of a collection, which is not read before."""

    def parse(text: str) -> str:
        if text not in known:
            raise ValueError(f"unknown value. {_none_called(text, known)}")
        return text

    return parse


def named_values(
    text: str,
    mark: str,
    parsers: Mapping[str, Callable[[str], Any]],
    known: Collection[str] | None = None,
) -> dict[str, Any]:
    """Parse values by name, with commas between.

    Args:
        mark: Stands between name and value.
        parsers: Parsers of the values, by name.
        known: The names, where they are those of a registry.
    """
    values: dict[str, Any] = {}
    for part in map(str.strip, text.split(",")):
        name, separator, value = part.partition(mark)
        if name not in parsers:
            rule = f"{name} is unknown" if separator else f"expected NAME{mark}VALUE"
            raise ValueError(f"{part!r}: {rule}. {_none_called(name, parsers if known is None else known)}")
        if not separator or name in values:
            fault = "given twice" if name in values else "without its value"
            raise ValueError(f"{part!r}: {name} is {fault}; expected NAME{mark}VALUE, each name once")
        try:
            values[name] = parsers[name](value)
        except ValueError as error:
            raise ValueError(f"{part!r}: {error}") from None
    return values


def _none_called(name: str, known: Collection[str]) -> str:
    return known.none_called(name) if isinstance(known, Registry) else did_you_mean(name, known)


def _number(text: str) -> float:
    """Parse a number; NaN, which breaks every rule, where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
