"""Formats of the numbers of a report: one format a kind of quantity, the same in every writer."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from typing import Any, ClassVar, Protocol

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.errors import counted as counted  # the report's modules take all their words from here
from pytest_libero_max.stats.blocks import McNemar, ProbeMean, Result, TaskInterval

NOT_AVAILABLE = "n/a"
"""Text in place of a number that does not exist."""

MISSING = "--"
"""The same in LaTeX, and in place of a text."""


class Ends(Protocol):
    """An interval; None at both ends where there is none."""

    @property
    def lower(self) -> float | None: ...

    @property
    def upper(self) -> float | None: ...


class Estimate(Ends, Protocol):
    """A value with its interval."""

    @property
    def value(self) -> float | None: ...


class Counted(Protocol):
    """A count and its denominator."""

    @property
    def count(self) -> int: ...

    @property
    def of(self) -> int: ...


class CountedEstimate(Estimate, Counted, Protocol):
    """A ratio with its counts and interval."""


@dataclass(frozen=True)
class Scale:
    """The values that a kind of quantity can have."""

    name: str
    least: int | None
    most: int | None
    """Largest value, None where there is none."""
    whole: bool = False
    percent: bool = True
    """True if a percentage makes sense."""


SHARE = Scale("a share from 0 to 1", 0, 1)
DIFFERENCE = Scale("a difference of shares from -1 to 1", -1, 1)
RATIO = Scale("a ratio of at least 0", 0, None)
P_VALUE = Scale("a p-value from 0 to 1", 0, 1)
COUNT = Scale("a count", 0, None, whole=True, percent=False)
AMOUNT = Scale("a number of at least 0", 0, None, percent=False)
NUMBER = Scale("a number", None, None, percent=False)


@dataclass(frozen=True)
class Unit:
    """A unit of numbers."""

    scale: Scale
    digits: int = 1
    """Decimals that are printed; of a share those of percent."""
    signed: bool = False
    text: str = ""
    """Text behind the number."""

    def number(self, value: float) -> str:
        """Return a value without the unit."""
        if self.scale in (SHARE, DIFFERENCE):
            return tenths(value, self.signed, self.digits)
        if self.scale is P_VALUE:
            return p_number(math.log10(max(value, sys.float_info.min)))  # of 0 there is no logarithm
        return f"{value:{'+' * self.signed}.{self.digits}f}"

    def amount(self, value: float | None) -> str:
        """Return a value with the unit."""
        return NOT_AVAILABLE if value is None else f"{self.number(value)}{self.text}"

    def ends(self, value: Ends) -> str:
        if value.lower is None or value.upper is None:
            return NOT_AVAILABLE
        return f"[{self.number(value.lower)}, {self.number(value.upper)}]"

    def estimate(self, value: Estimate) -> str:
        """Return a value with the unit, and its interval where it has one."""
        text = self.amount(value.value)
        return text if value.value is None or value.lower is None else f"{text} {self.ends(value)}"


PERCENT = Unit(SHARE, text="%")
POINTS = Unit(DIFFERENCE, signed=True, text=" pp")


class Format:
    """Format of one kind of quantity.

    ``value`` is the quantity in the report: a number, or a block with a number, its counts and its interval.
    A number that does not exist is None there.
    """

    _scale: ClassVar[Scale] = COUNT

    has_interval: ClassVar[bool] = False
    """True if there are ``lower`` and ``upper`` ends."""

    @property
    def scale(self) -> Scale:
        """The values there can be, which gates compare with."""
        return self._scale

    def long(self, value: Any) -> str:
        """With counts and interval, for wide tables."""
        raise NotImplementedError

    def short(self, value: Any) -> str:
        return self.long(value)

    def latex(self, value: Any) -> str:
        """For a LaTeX table whose caption says percent and percentage points."""
        text = self.short(value)
        return MISSING if text == NOT_AVAILABLE else latex_escaped(text)

    def numbers(self, value: Any) -> dict[str, Any]:
        """Return the bare numbers by the end of their name: ``""`` (estimate), ``_lower`` and ``_upper``."""
        return {"": value}


def _math(value: float | None, signed: bool) -> str:
    return MISSING if value is None else f"${tenths(value, signed)}$" if signed else tenths(value)


@dataclass(frozen=True)
class Text(Format):
    """A text, a whole number, or nothing."""

    def long(self, value: object) -> str:
        if isinstance(value, str):
            return value
        return MISSING if value is None else str(value)


class _WithInterval(Format):
    has_interval: ClassVar[bool] = True

    def numbers(self, value: Estimate) -> dict[str, float | None]:
        return {"": value.value, "_lower": value.lower, "_upper": value.upper}


@dataclass(frozen=True)
class Rate(_WithInterval):
    """A share of cases with its 95% interval."""

    counted: bool = False
    """Narrow tables print the counts instead of the percentage."""
    _scale: ClassVar[Scale] = SHARE

    def long(self, value: CountedEstimate) -> str:
        return rate_text(value)

    def short(self, value: CountedEstimate) -> str:
        return count_text(value) if self.counted else percent(value.value)

    def latex(self, value: CountedEstimate) -> str:
        return _math(value.value, signed=False)


@dataclass(frozen=True)
class Change(_WithInterval):
    """A difference of rates with its 95% interval, in percentage points."""

    _scale: ClassVar[Scale] = DIFFERENCE

    def long(self, value: Estimate) -> str:
        return change_text(value)

    def short(self, value: Estimate) -> str:
        return change_text(value).replace(POINTS.text, "")

    def latex(self, value: Estimate) -> str:
        change = _math(value.value, signed=True)
        return change if value.value is None or value.lower is None else f"{change} {Interval().latex(value)}"


@dataclass(frozen=True)
class Interval(Format):
    """The ends of an interval in percent."""

    has_interval: ClassVar[bool] = True

    signed: bool = True
    """True for those of a change."""

    @property
    def scale(self) -> Scale:
        return DIFFERENCE if self.signed else SHARE

    def long(self, value: Any) -> str:
        return NOT_AVAILABLE if value is None else interval_text(value, self.signed)

    def latex(self, value: Any) -> str:
        if value is None or value.lower is None or value.upper is None:
            return MISSING
        return f"[{', '.join(f'${tenths(end, self.signed)}$' for end in (value.lower, value.upper))}]"

    def numbers(self, value: Any) -> dict[str, float | None]:
        return {f"_{end}": None if value is None else getattr(value, end) for end in ("lower", "upper")}


@dataclass(frozen=True)
class IntervalByTask(Interval):
    """An interval by task; says why there is none."""

    def long(self, value: TaskInterval) -> str:
        if value.lower is None:
            return f"n/a: {lack_of_tasks(value)}"
        return f"{self.short(value)}  {counted(value.tasks, 'task')}"

    def short(self, value: TaskInterval) -> str:
        return interval_text(value, signed=self.signed)

    def numbers(self, value: TaskInterval) -> dict[str, float | None]:
        return {"": value.value, **super().numbers(value)}


@dataclass(frozen=True)
class Share(Format):
    """A ratio of two counts without an interval."""

    signed: bool = False
    """It is a difference of rates, printed in percentage points with its sign."""

    @property
    def scale(self) -> Scale:
        return DIFFERENCE if self.signed else RATIO

    def long(self, value: Any) -> str:
        return self.short(value) + ("" if self.signed else f"  {count_text(value)}")

    def short(self, value: Any) -> str:
        return (POINTS if self.signed else PERCENT).amount(value.value)

    def latex(self, value: Any) -> str:
        return MISSING if value.value is None else f"${tenths(value.value, self.signed)}$"

    def numbers(self, value: Any) -> dict[str, float | None]:
        return {"": value.value}


@dataclass(frozen=True)
class Counts(Format):
    """A count over its denominator, for example ``3/8``."""

    def long(self, value: Any) -> str:
        return count_text(value)

    def numbers(self, value: Any) -> dict[str, float | None]:
        return {"": value.count, "_of": value.of}


@dataclass(frozen=True)
class Tenths(Format):
    """A share in percent, or a difference of shares in percentage points, without its unit."""

    signed: bool = True
    missing: str = NOT_AVAILABLE
    """Text where there is none."""

    def long(self, value: float | None) -> str:
        return self.missing if value is None else tenths(value, self.signed)

    def latex(self, value: float | None) -> str:
        return _math(value, self.signed)


@dataclass(frozen=True)
class Percent(Format):
    """A share in percent, with its unit."""

    def long(self, value: float | None) -> str:
        return percent(value)


@dataclass(frozen=True)
class Number(Format):
    """A plain number."""

    spec: str = "d"
    """A format specification, for example ``.2f``."""
    missing: str = NOT_AVAILABLE
    """Text where there is none."""

    @property
    def scale(self) -> Scale:
        return COUNT if self.spec == "d" else AMOUNT

    def long(self, value: float | None) -> str:
        return self.missing if value is None else f"{value:{self.spec}}"


@dataclass(frozen=True)
class Mean(Format):
    """A mean over pairs, and the largest value of a pair."""

    _scale: ClassVar[Scale] = NUMBER

    def long(self, value: ProbeMean | None) -> str:
        if value is None:
            return NOT_AVAILABLE
        return f"{value.mean:.6g}, largest {value.largest:.6g}  {counted(value.pairs, 'pair')}"

    def numbers(self, value: ProbeMean | None) -> dict[str, float | None]:
        if value is None:
            return {"": None, "_largest": None}
        return {"": value.mean, "_largest": value.largest}


@dataclass(frozen=True)
class PairCount(Format):
    """Number of played pairs, and of planned ones where one is missing."""

    def long(self, value: Result) -> str:
        return f"{value.played} of {value.planned}"

    def short(self, value: Result) -> str:
        return str(value.played) if value.played == value.planned else self.long(value)

    def numbers(self, value: Result) -> dict[str, float | None]:
        return {"": value.played}


@dataclass(frozen=True)
class PValue(Format):
    """A p-value; a small one is printed from its logarithm, never as 0."""

    _scale: ClassVar[Scale] = P_VALUE

    def long(self, value: McNemar) -> str:
        return NOT_AVAILABLE if value.log10_p_value is None else f"p = {self.short(value)}"

    def short(self, value: McNemar) -> str:
        return LogP().long(value.log10_p_value)

    def numbers(self, value: McNemar) -> dict[str, float | None]:
        return {"": value.p_value}


@dataclass(frozen=True)
class LogP(Format):
    """A p-value from its decimal logarithm."""

    def long(self, value: float | None) -> str:
        return NOT_AVAILABLE if value is None else p_number(value)


_LATEX = {letter: f"\\{letter}" for letter in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
"""Letters that mean something to LaTeX, as it prints them."""


def latex_escaped(text: str) -> str:
    """Return a text as LaTeX prints it."""
    return "".join(_LATEX.get(letter, letter) for letter in printable(text))


def rate_text(rate: CountedEstimate) -> str:
    """Return a rate with its interval and counts, for example ``75.0% [57.9, 86.7]  24/32``."""
    return f"{PERCENT.estimate(rate)}  {count_text(rate)}"


def change_text(change: Estimate) -> str:
    """Return a paired change with its interval, for example ``-12.5 pp [-25.0, -3.1]``."""
    return POINTS.estimate(change)


def interval_text(value: Ends, signed: bool = False) -> str:
    """Return an interval in percent."""
    return (POINTS if signed else PERCENT).ends(value)


def tenths(value: float, signed: bool = False, decimals: int = 1) -> str:
    """Return a share in percent, one decimal or more; ties are rounded away from zero, as in the paper."""
    rounded = (Decimal(repr(value)) * 100).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)
    return f"{rounded:+}" if signed else str(rounded)


def percent(value: float | None) -> str:
    """Return a rate as a percentage with one decimal."""
    return PERCENT.amount(value)


def points(value: float | None) -> str:
    """Return a difference of rates in percentage points, with its sign."""
    return NOT_AVAILABLE if value is None else tenths(value, True)


def lack_of_tasks(value: TaskInterval) -> str:
    """Return why there is no interval by task, for example ``too few tasks (23 of 30 needed)``."""
    from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS

    if value.withheld:
        return "a rule stopped the run"
    if value.tasks < LEAST_TASKS:
        return f"too few tasks ({value.tasks} of {LEAST_TASKS} needed)"
    if value.effective_tasks < LEAST_TASKS:
        return (
            f"too few tasks (the {value.tasks} of unequal size count as {value.effective_tasks:.1f} of "
            f"{LEAST_TASKS} needed)"
        )
    return f"outcomes differ in too few tasks ({value.changed_tasks} of {LEAST_CHANGED_TASKS} needed)"


def count_text(ratio: Counted) -> str:
    """Return a count over its denominator, for example ``3/8``."""
    return f"{ratio.count}/{ratio.of}"


def p_number(log10_p: float) -> str:
    """Return a p-value from its decimal logarithm."""
    if log10_p >= -3:
        return f"{10**log10_p:.3f}"
    exponent = math.floor(log10_p)
    return f"{10 ** (log10_p - exponent):.1f}e{exponent}"
