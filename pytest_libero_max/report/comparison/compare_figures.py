"""Figures of a comparison as standalone SVG documents: its runs by event and by outcome."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable, Mapping

from msgspec.structs import replace

from pytest_libero_max.report.comparison.comparison_document import Comparison, OverRuns
from pytest_libero_max.report.comparison.comparison_sections import with_short_names
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.palette import BOX, GAIN, GRID, INK, LIGHT_GAIN, LOSS, MUTED, ON_LIGHT, SECOND
from pytest_libero_max.report.writers.svg import circle, document, line, rectangle, text

_LABEL, _PLOT, _NOTE, _MARGIN = 190, 480, 190, 12
_LEAST_BOXED = 5
"""Number of runs from which on median, quartiles and range say something of them."""

_LANE = 7
"""Height of one run within the row of an event."""

_OUTCOMES = (
    ("preserved_success", "preserved success", GAIN, "white"),
    ("change_associated_success", "change-associated success", LIGHT_GAIN, ON_LIGHT),
    ("regression", "regression", LOSS, "white"),
    ("persistent_failure", "persistent failure", GRID, INK),
)


def event_changes(comparison: Comparison) -> str:
    """Paired change by event: a dot for every run, and median, quartiles and range over the runs."""
    runs, events = comparison.runs, comparison.events
    colors = distinct_colors(len(runs))
    low, high = _limits(comparison)
    top, row = 34, _LANE * len(runs) + 18

    def place(change: float) -> float:
        return _LABEL + _PLOT * (change - low) / (high - low)

    bottom = top + row * len(events)
    shapes = []
    step = 2 if high - low > 0.6 else 1
    for tick in range(round(low * 10), round(high * 10) + 1):
        if tick % step:
            continue
        x = place(tick / 10)
        shapes += [
            line(x, top, x, bottom, INK if tick == 0 else GRID),
            text(x, top - 10, f"{10 * tick:+d}" if tick else "0", "middle", 11, MUTED),
        ]
    for index, (event, over_runs) in enumerate(events.items()):
        begin = top + row * index + 5
        middle, height = begin + (row - 10) / 2, row - 10
        changes = [run.by_event[event].value or 0.0 for run in runs]
        if len(runs) == 2:
            worse = changes[1] < changes[0]
            shapes.append(
                line(place(changes[0]), middle, place(changes[1]), middle, LOSS if worse else GAIN, 3)
            )
            note = " to ".join(map(points, changes))
        elif len(runs) < _LEAST_BOXED:
            note = f"{points(over_runs.lowest)} to {points(over_runs.highest)}"
        else:
            lower, upper = place(over_runs.lower_quartile), place(over_runs.upper_quartile)
            median = place(over_runs.median)
            shapes += [
                line(place(over_runs.lowest), middle, place(over_runs.highest), middle, MUTED),
                rectangle(lower, begin, max(upper - lower, 1), height, BOX),
                line(median, begin, median, begin + height, INK, 2),
            ]
            note = _over_runs_text(over_runs)
        shapes += [
            text(_LABEL - 10, middle + 4, event, "end"),
            text(_LABEL + _PLOT + 14, middle + 4, note, color=MUTED),
        ]
        for lane, (change, color) in enumerate(zip(changes, colors, strict=True)):
            y = middle if len(runs) == 2 else begin + 4 + _LANE * (lane + 0.5)
            radius = (7, 5)[lane] if len(runs) == 2 else 3.5  # the first is seen below an equal second
            shapes.append(circle(place(change), y, radius, color))
    for number, (run, color) in enumerate(zip(runs, colors, strict=True)):
        y = bottom + 22 + 18 * number
        shapes += [circle(_LABEL + 6, y - 4, 4.5, color), text(_LABEL + 18, y, str(run.name))]
    height = bottom + 22 + 18 * len(runs)
    title = "Paired change by event, percentage points"
    title += ", median, quartiles and range" if len(runs) >= _LEAST_BOXED else ""
    return document(_LABEL + _PLOT + _NOTE, height, title, shapes)


def outcome_shares(comparison: Comparison) -> str:
    """Return the four outcomes (Base, Dynamic) as shares of the common cases, a bar for every run."""
    runs, top, row = comparison.runs, 40, 26
    shapes, x = [], float(_LABEL)
    for _, words, color, _ in _OUTCOMES:
        shapes += [rectangle(x, 10, 12, 12, color), text(x + 17, 20, words, size=11)]
        x += 34 + 6.2 * len(words)
    for index, run in enumerate(runs):
        y, begin = top + row * index, float(_LABEL)
        shapes.append(text(_LABEL - 10, y + row / 2 + 4, str(run.name), "end"))
        cases = sum(getattr(run.outcomes, key) for key, *_ in _OUTCOMES)
        for key, _, color, ink in _OUTCOMES:
            share = getattr(run.outcomes, key) / cases
            width = (_PLOT + _NOTE - _MARGIN) * share
            shapes.append(rectangle(begin, y + 2, width, row - 4, color))
            if width > 36:
                shapes.append(text(begin + width / 2, y + row / 2 + 4, percent(share), "middle", 11, ink))
            begin += width
    height = top + row * len(runs) + _MARGIN
    return document(_LABEL + _PLOT + _NOTE, height, "Outcomes (Base, Dynamic), shares of the cases", shapes)


COMPARISON_FIGURES: Mapping[str, Callable[[Comparison], str]] = {
    "event-changes": event_changes,
    "outcome-shares": outcome_shares,
}
"""Every figure of a comparison by the stem of its file name."""

CAPTIONS = {
    "event-changes": "Paired change by event in percentage points. A dot is a run. The line between two runs "
    "is red where the second loses more, blue where it loses less. From five runs on the line is their "
    "range, the box reaches from the lower to the upper quartile, and the bar in it is the median.",
    "outcome-shares": "Outcomes of the pairs (Base, Dynamic) of every run, as shares of the common cases.",
}
"""Captions of the figures."""


def drawn(comparison: Comparison) -> dict[str, str]:
    """Every figure, its runs named briefly."""
    shown = with_short_names(replace(comparison, flips=[]))
    return {stem: draw(shown) for stem, draw in COMPARISON_FIGURES.items()}


def _over_runs_text(over_runs: OverRuns) -> str:
    quartiles = f"{points(over_runs.lower_quartile)}, {points(over_runs.upper_quartile)}"
    return f"{points(over_runs.median)} [{quartiles}]"


def _limits(comparison: Comparison) -> tuple[float, float]:
    """Return the ends of the axis: tenths, with zero and every change within."""
    lowest = min(over_runs.lowest for over_runs in comparison.events.values())
    highest = max(over_runs.highest for over_runs in comparison.events.values())
    low, high = min(math.floor(10 * lowest), 0), max(math.ceil(10 * highest), 0)
    return low / 10, max(high, low + 1) / 10


def distinct_colors(count: int) -> list[str]:
    """Return distinct colours, dark and light in turn, none of them the red of a loss."""
    colors = [INK, SECOND]
    for number in range(count - len(colors)):
        channels = colorsys.hls_to_rgb(0.15 + 0.7 * number / count, (0.36, 0.52)[number % 2], 0.65)
        colors.append("#" + "".join(f"{round(255 * channel):02x}" for channel in channels))
    return colors
