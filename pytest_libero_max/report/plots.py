"""Plots as data: a page and an SVG file draw the same values, names and texts.

A *kind* is the name of a colour of :mod:`~pytest_libero_max.report.palette`, which is a class of the style
sheet as well; ``ring`` behind it makes a dot hollow. Values are shares, or differences of shares.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from pytest_libero_max.report.formats import Ends, Estimate
from pytest_libero_max.stats.blocks import Outcomes

OUTCOME_TITLES = {
    "preserved_success": "preserved",
    "change_associated_success": "gain",
    "regression": "regression",
    "persistent_failure": "persistent failure",
    "invalid": "invalid",
    "missing": "missing",
    "unsupported": "unsupported",
}
"""Titles of the outcomes; the last three are of pairs without a record."""

OUTCOME_KINDS = {
    "preserved_success": "gain",
    "change_associated_success": "light-gain",
    "regression": "loss",
    "persistent_failure": "grey",
}

_RUN_COLOURS = 8
_MOST_TICKS = 5
_STEPS = (0.05, 0.1, 0.2, 0.25, 0.5)
_MOST_LABELS = 12


class Viewed(NamedTuple):
    """A name that leads to a view of the table of cases."""

    text: str
    view: str
    """Text behind ``#cases?`` in the address of the view; empty where the name leads nowhere."""

    def __str__(self) -> str:
        return self.text


def run_kind(number: int) -> str:
    """Return the kind of a run, counted from 0; colours come again as rings."""
    return f"run{number % _RUN_COLOURS}" + " ring" * (number // _RUN_COLOURS % 2)


def direction(change: Ends) -> str:
    """Return ``loss`` or ``gain`` where the interval of a change excludes zero, otherwise ``neutral``."""
    if change.lower is None or change.upper is None or change.lower <= 0 <= change.upper:
        return "neutral"
    return "loss" if change.upper < 0 else "gain"


class Axis:
    """An axis with zero on it, whose ends are ticks.

    Args:
        signed: True for changes; False for shares, which reach to 1.
    """

    def __init__(self, values: Iterable[float], *, signed: bool = True) -> None:
        known = [0.0, *values] if signed else [0.0, 1.0, *values]
        low, high = min(known), max(known)
        self._step = next((step for step in _STEPS if (high - low) / step < _MOST_TICKS), _STEPS[-1])
        self._first = math.floor(low / self._step + 1e-9)
        self._last = max(math.ceil(high / self._step - 1e-9), self._first + 1)
        self._signed = signed

    def at(self, value: float) -> float:
        """Return the place of a value in percent of the axis."""
        return round(100 * (value / self._step - self._first) / (self._last - self._first), 2)

    @property
    def ticks(self) -> list[tuple[float, str]]:
        values = [number * self._step for number in range(self._first, self._last + 1)]
        if self._signed:
            return [(self.at(value), f"{100 * value:+g}".replace("+0", "0")) for value in values]
        return [(self.at(value), f"{100 * value:g}") for value in values]


class Row(NamedTuple):
    """A row of a plot."""

    name: Viewed | str
    """Name; it may lead to the cases of the row."""
    note: str
    text: str
    dots: Sequence[tuple[float, str]] = ()
    span: tuple[float, float, str] | None = None
    """Both ends of a line, and its kind."""
    box: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Plot:
    """Rows over one axis."""

    title: str
    head: tuple[str, str]
    rows: Sequence[Row]
    legend: Sequence[tuple[str, str]] = ()
    """Kinds and names of the dots, where rows have several; the dots of a row are in this order."""
    signed: bool = True
    """True for changes in percentage points; False for shares in percent."""
    note: str = ""

    @cached_property
    def axis(self) -> Axis:
        values = [value for row in self.rows for value, _ in row.dots]
        values += [end for row in self.rows if row.span for end in row.span[:2]]
        return Axis(values, signed=self.signed)


def change_plot(title: str, names: str, rows: Sequence[Row], note: str = "") -> Plot:
    """Return a plot of changes; its heading announces intervals where there are some."""
    return Plot(title, (names, "pp [95%]" if any(row.span for row in rows) else "pp"), rows, note=note)


def rates_row(name: Viewed | str, note: str, base: float | None, dynamic: float | None, text: str) -> Row:
    """Return a row of success rates: a ring for Base, a dot for Dynamic, and the line between them."""
    if base is None or dynamic is None:
        return Row(name, note, text)
    kind = "loss" if dynamic < base else "gain" if dynamic > base else "neutral"
    return Row(name, note, text, [(base, "arm0 ring"), (dynamic, kind)], (base, dynamic, kind))


def change_row(name: Viewed | str, note: str, change: Estimate, text: str) -> Row:
    """Return a row of a change: its dot in the colour of its sign, its line in that of what it shows."""
    if change.value is None:
        return Row(name, note, text)
    ends = (change.lower, change.upper)
    span = None if ends[0] is None or ends[1] is None else (ends[0], ends[1], direction(change))
    sign = "loss" if change.value < 0 else "gain" if change.value > 0 else "neutral"
    return Row(name, note, text, [(change.value, sign)], span)


COLOURS_NOTE = "A dot is red below 0 and blue above. Its line is the 95% interval, grey where that holds 0."
"""Explanation of the colours of :func:`change_row`."""


class Segment(NamedTuple):
    """An outcome in a bar of outcomes."""

    outcome: str
    """Key of the outcome, which is the class of its colour."""
    title: str
    pairs: int
    width: float
    """Share of the bar, percent."""


def outcome_bar(outcomes: Outcomes) -> list[Segment]:
    """Return the outcomes of pairs as parts of a bar, those without a pair included."""
    total = outcomes.total or 1
    counts = {key: getattr(outcomes, key) for key in OUTCOME_KINDS}
    return [
        Segment(key, OUTCOME_TITLES[key], count, round(100 * count / total, 2))
        for key, count in counts.items()
    ]


class Bars(NamedTuple):
    """The outcomes of several runs as bars."""

    title: str
    rows: Sequence[tuple[str, Sequence[Segment]]]


class Heat(NamedTuple):
    """A cell of a map."""

    change: float
    pairs: int
    view: str

    @property
    def text(self) -> str:
        return f"{100 * self.change:+.0f}" if self.change else "0"

    @property
    def kind(self) -> str:
        return "loss" if self.change < 0 else "gain"

    @property
    def weight(self) -> int:
        """Strength of its colour, percent."""
        return round(min(1.0, 2 * abs(self.change)) * 50)


class HeatMap(NamedTuple):
    """Changes by two groupings."""

    title: str
    columns: Sequence[str]
    rows: Sequence[tuple[Viewed, Sequence[Heat | None]]]
    """Names and cells; None where no pair was played."""


class Histogram(NamedTuple):
    """Pairs by a whole number from 0 on."""

    title: str
    axis: str
    """What the number is."""
    counts: Sequence[int]

    @classmethod
    def of(cls, title: str, axis: str, counts: Mapping[str, int]) -> Histogram:
        """Return a histogram of counts by number, written as text."""
        known = {int(number): pairs for number, pairs in counts.items()}
        return cls(title, axis, [known.get(number, 0) for number in range(max(known, default=0) + 1)])

    @property
    def bars(self) -> list[tuple[str, int, float]]:
        """Label (empty where there is no room), count and height in percent of each bar."""
        most, every = max(self.counts) or 1, 1 + (len(self.counts) - 1) // _MOST_LABELS
        return [
            ("" if number % every else str(number), count, round(100 * count / most, 1))
            for number, count in enumerate(self.counts)
        ]


class Scatter(NamedTuple):
    """Points over success in Base, in panels side by side."""

    title: str
    axis: str
    """What a point is."""
    panels: Mapping[str, Sequence[tuple[float, float, str]]]
    """By title, points: Base success, paired change, and kind."""
    legend: Sequence[tuple[str, str]]


Drawable = Plot | Bars | HeatMap | Histogram | Scatter
