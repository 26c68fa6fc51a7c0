"""Charts of a page, as numbers for its templates: places along an axis in percent fit every window."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple
from urllib.parse import urlencode

from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.formats import Ends, Estimate, interval_text, points
from pytest_libero_max.report.page.page_frame import Viewed
from pytest_libero_max.report.report_document import Cell, Report
from pytest_libero_max.stats.blocks import Outcomes, Result

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

_MEASURED = [*OUTCOME_TITLES][:4]

RUN_COLOURS = 8
"""Number of colours of runs in the style sheet; they begin again after the last."""

_MOST_TICKS = 5
_STEPS = (0.05, 0.1, 0.2, 0.25, 0.5)
_MOST_LABELS = 12


class Row(NamedTuple):
    """A row of a plot."""

    name: Viewed | str
    """Of the row; it may lead to its cases."""
    note: str
    """Number of pairs."""
    text: str
    """The numbers."""
    dots: Sequence[tuple[float, str]]
    """Places with the class of their colour."""
    span: tuple[float, float, str] | None
    """Places of the two ends of a line, and the class of its colour; None for no line."""


class Plot(NamedTuple):
    """Rows over one axis in percentage points."""

    head: tuple[str, str]
    """Headings of the names and of the numbers."""
    ticks: Sequence[tuple[float, str]]
    """Places and labels."""
    zero: float
    """Place of no change."""
    rows: Sequence[Row]
    """From top to bottom."""


class Segment(NamedTuple):
    """An outcome in a bar of outcomes."""

    outcome: str
    """Its key, which is the class of its colour."""
    title: str
    """For people."""
    pairs: int
    """Number of them."""
    width: float
    """Share of the bar, percent."""


class _Axis:
    """An axis of shares with zero on it; its ends are ticks."""

    def __init__(self, values: Iterable[float]) -> None:
        found = [0.0, *values]
        low, high = min(found), max(found)
        step = next((step for step in _STEPS if (high - low) / step < _MOST_TICKS), _STEPS[-1])
        self.first = math.floor(low / step + 1e-9)
        self.last = max(math.ceil(high / step - 1e-9), self.first + 1)
        self.step = step

    def at(self, value: float) -> float:
        return round(100 * (value / self.step - self.first) / (self.last - self.first), 2)

    def plot(self, head: tuple[str, str], rows: Sequence[Row]) -> Plot:
        numbers = range(self.first, self.last + 1)
        ticks = [
            (self.at(number * self.step), f"{100 * number * self.step:+g}".replace("+0", "0"))
            for number in numbers
        ]
        return Plot(head, ticks, self.at(0.0), rows)


def direction(change: Ends) -> str:
    """Return ``loss`` or ``gain`` where the interval of a change excludes zero, otherwise ``neutral``."""
    if change.lower is None or change.upper is None or change.lower <= 0 <= change.upper:
        return "neutral"
    return "loss" if change.upper < 0 else "gain"


def forest(overall: Result, events: Mapping[str, Result]) -> Plot:
    """Return the paired change of all pairs and of the events, the lowest first, with their intervals.

    The numbers of all pairs are left out: they stand beside it as the headline.
    """
    shown = sorted(events.items(), key=lambda item: (item[1].paired_change.value or 0.0, item[0]))
    results = [(Viewed("all pairs", ""), overall)]
    results += [
        (Viewed(f"{name}{' *' * bool(row.floor)}", urlencode({"event": name})), row) for name, row in shown
    ]
    changes = [row.paired_change for _, row in results]
    axis = _Axis(
        end for change in changes for end in (change.value, change.lower, change.upper) if end is not None
    )
    rows = []
    for name, row in results:
        change, pairs = row.paired_change, str(row.played)
        if row.played != row.planned:
            pairs += f"/{row.planned}"
        if change.value is None:
            rows.append(Row(name, pairs, "n/a", [], None))
            continue
        kind = direction(change)
        span = None
        if change.lower is not None and change.upper is not None:
            span = (axis.at(change.lower), axis.at(change.upper), kind)
        text = f"{points(change.value)} {interval_text(change, signed=True)}" if name.view else ""
        rows.append(Row(name, pairs, text, [(axis.at(change.value), kind)], span))
    return axis.plot(("Event (pairs)", "pp [95%]"), rows)


def runs_by_event(comparison: Comparison) -> Plot:
    """Return the paired changes of runs by event: a dot a run, and for two runs the line between them."""
    runs = comparison.runs
    axis = _Axis(run.by_event[event].value or 0.0 for run in runs for event in comparison.events)
    rows = []
    for event, over_runs in comparison.events.items():
        values = [run.by_event[event].value or 0.0 for run in runs]
        dots = [(axis.at(value), f"run{number % RUN_COLOURS}") for number, value in enumerate(values)]
        if len(runs) == 2:
            first, second = values
            kind = "loss" if second < first else "gain"
            span = (dots[0][0], dots[1][0], kind) if first != second else None
            rows.append(
                Row(
                    Viewed(event, urlencode({"event": event})),
                    "",
                    " to ".join(map(points, values)),
                    dots,
                    span,
                )
            )
        else:
            text = f"{points(over_runs.lowest)} to {points(over_runs.highest)}"
            rows.append(Row(Viewed(event, urlencode({"event": event})), "", text, dots, None))
    numbers = "First to second, pp" if len(runs) == 2 else "Lowest to highest, pp"
    return axis.plot(("Event", numbers), rows)


class Point(NamedTuple):
    """A value of a run with its interval: places in percent of a chart, from its left and from its top."""

    x: float
    """Of the run."""
    y: float
    """Of the value."""
    lower: float
    """Of the lower end of its interval."""
    upper: float
    """Of the upper end."""
    kind: str
    """Class of the colour."""


class Series(NamedTuple):
    """A line over runs."""

    kind: str
    """Class of the colour."""
    points: Sequence[Point]
    """One a run that has the value."""

    @property
    def pairs(self) -> Iterable[tuple[Point, Point]]:
        """Points that a line joins."""
        return pairwise(self.points)


class Lines(NamedTuple):
    """Values over runs, from left to right."""

    ticks: Sequence[tuple[float, str]]
    """Places from the top, and labels in percent."""
    zero: float | None
    """Place of zero; None where it is the lower end of the axis."""
    labels: Sequence[tuple[float, int]]
    """Places from the left, and numbers of runs, of which a part is left out where there are many."""
    series: Sequence[Series]
    """The lines."""


def over_runs(values: Mapping[str, Sequence[Estimate]], *, signed: bool = False) -> Lines:
    """Return values of runs with their intervals.

    Args:
        values: One a run, in their order, by class of the colour; the empty class colours each value by what
            its interval shows.
        signed: True for changes; False for shares, which are from 0 to 1.
    """
    ends = [end for row in values.values() for one in row for end in (one.value, one.lower, one.upper)]
    axis = _Axis([end for end in ends if end is not None] + ([] if signed else [1.0]))
    count = len(next(iter(values.values())))
    places = [round(100 * (number + 0.5) / count, 2) for number in range(count)]
    aside = [min(1.0, 15 / count) * side for side in ((-1, 1) if len(values) > 1 else (0,))]

    def down(value: float) -> float:
        return round(100 - axis.at(value), 2)

    series = []
    for (kind, row), shift in zip(values.items(), aside, strict=True):
        points = [
            Point(
                x + shift,
                down(one.value),
                down(one.value if one.lower is None else one.lower),
                down(one.value if one.upper is None else one.upper),
                kind or direction(one),
            )
            for x, one in zip(places, row, strict=True)
            if one.value is not None
        ]
        series.append(Series(kind or "neutral", points))
    plot = axis.plot(("", ""), [])
    ticks = [(round(100 - at, 2), words if signed else words.lstrip("+")) for at, words in plot.ticks]
    every = 1 + (count - 1) // _MOST_LABELS
    labels = [(x, number) for number, x in enumerate(places, 1) if (number - 1) % every == 0]
    return Lines(ticks, down(0.0) if signed else None, labels, series)


def outcome_bar(outcomes: Outcomes) -> list[Segment]:
    """Return the outcomes of pairs as parts of a bar, those without a pair included."""
    counts = {key: getattr(outcomes, key) for key in _MEASURED}
    total = sum(counts.values()) or 1
    return [
        Segment(key, OUTCOME_TITLES[key], count, round(100 * count / total, 2))
        for key, count in counts.items()
    ]


class Heat(NamedTuple):
    """A cell of the map of source categories and events."""

    text: str
    """Paired change in whole percentage points."""
    pairs: int
    """Number of pairs."""
    view: str
    """View of the table of cases."""
    kind: str
    """``loss`` or ``gain``."""
    weight: int
    """Strength of its colour, percent."""


def category_map(report: Report) -> tuple[list[str], list[tuple[Viewed, list[Heat | None]]]]:
    """Return the events, and for each source category a cell an event; None where no pair was played."""
    events = [event for event in EVENTS if event in report.by["event"]]
    rows = [
        (
            Viewed(category, urlencode({"category": category})),
            [_heat(category, event, cells.get(event)) for event in events],
        )
        for category, cells in report.category_by_event.items()
    ]
    return events, rows


def _heat(category: str, event: str, cell: Cell | None) -> Heat | None:
    if cell is None or cell.paired_change.value is None:
        return None
    change = cell.paired_change
    value = change.value or 0.0
    return Heat(
        f"{100 * value:+.0f}" if value else "0",
        change.of,
        urlencode({"category": category, "event": event}),
        "loss" if value < 0 else "gain",
        round(min(1.0, 2 * abs(value)) * 50),
    )


def histogram(counts: Mapping[str, int]) -> list[tuple[str, int, float]]:
    """Return a bar for every whole number up to the last: its label, its count, and its height in percent.

    Args:
        counts: Pairs by number, written as text.
    """
    found = {int(number): pairs for number, pairs in counts.items()}
    last, most = max(found, default=0), max(found.values(), default=1)
    every = 1 + last // _MOST_LABELS
    return [
        (
            "" if number % every else str(number),
            found.get(number, 0),
            round(100 * found.get(number, 0) / most, 1),
        )
        for number in range(last + 1)
    ]
