"""Figures of a report as standalone SVG documents."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.report.formats import interval_text, percent, points
from pytest_libero_max.report.palette import ARMS, GAIN, GRID, INK, LOSS, MUTED, NEUTRAL, ON_LIGHT
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.svg import (
    arrow,
    circle,
    document,
    labelled_lines,
    line,
    rectangle,
    shade,
    staircase,
    text,
)
from pytest_libero_max.stats.blocks import Result

_ROW, _LABEL, _PLOT, _NOTE, _TOP = 26, 220, 420, 170, 34


def arrow_plot(report: Report) -> str:
    """Success rates: a ring for Base, an arrow to Dynamic, one row an event and one for all pairs."""
    rows = {"all pairs": report.overall, **report.by["event"]}
    marks = [(_share(tick / 100), f"{tick}%") for tick in range(0, 101, 20)]
    shapes = labelled_lines(marks, _TOP, _TOP + _ROW * len(rows))
    for index, (name, block) in enumerate(rows.items()):
        y = _TOP + _ROW * (index + 0.5)
        base, dynamic = block.base_success.value, block.dynamic_success.value
        shapes.append(_label(name, block, y))
        if base is None or dynamic is None:
            continue
        color = _direction(dynamic - base)
        shapes += [
            arrow(_share(base), _share(dynamic), y, color),
            circle(_share(base), y, 5, "white", INK),
            text(_LABEL + _PLOT + 16, y + 4, f"{percent(base)} to {percent(dynamic)}", color=MUTED),
        ]
    return _figure(len(rows), "Base to Dynamic success by event", shapes)


def change_profile(report: Report) -> str:
    """Paired changes with their 95% intervals, one row an event and one for all pairs."""
    rows = {"all pairs": report.overall, **report.by["event"]}
    marks = [(_signed(tick / 100), f"{tick:+d}") for tick in range(-100, 101, 50)]
    shapes = labelled_lines(marks, _TOP, _TOP + _ROW * len(rows))
    shapes.append(line(_signed(0), _TOP, _signed(0), _TOP + _ROW * len(rows), INK))
    for index, (name, block) in enumerate(rows.items()):
        y = _TOP + _ROW * (index + 0.5)
        change = block.paired_change
        shapes.append(_label(name, block, y))
        if change.value is None:
            continue
        color = _direction(change.value)
        if change.lower is not None and change.upper is not None:
            shapes.append(line(_signed(change.lower), y, _signed(change.upper), y, color, 2.5))
        note = f"{points(change.value)} {interval_text(change, signed=True)}"
        shapes += [
            circle(_signed(change.value), y, 5, color),
            text(_LABEL + _PLOT + 16, y + 4, note, color=MUTED),
        ]
    return _figure(len(rows), "Paired change in percentage points by event", shapes)


def category_map(report: Report) -> str:
    """Paired change of every source category under every event; grey where no pair was played."""
    cells = report.category_by_event
    events = [event for event in EVENTS if event in report.by["event"]]
    width, top = 84, 58
    shapes: list[str] = []
    for column, event in enumerate(events):
        first, _, second = event.partition("_")
        x = _LABEL + width * (column + 0.5)
        shapes += [text(x, 24, first, "middle"), text(x, 40, second.replace("_", " "), "middle", 11, MUTED)]
    for row, (category, by_event) in enumerate(cells.items()):
        y = top + _ROW * row
        shapes.append(text(_LABEL - 10, y + _ROW / 2 + 4, category, "end"))
        for column, event in enumerate(events):
            change = by_event[event].paired_change if event in by_event else None
            x = _LABEL + width * column
            if change is None or change.value is None:
                shapes.append(rectangle(x + 1, y + 1, width - 2, _ROW - 2, GRID))
                continue
            strong = abs(change.value) > 0.3
            words = f"{points(change.value)} ({change.of})"
            shapes += [
                rectangle(x + 1, y + 1, width - 2, _ROW - 2, shade(change.value)),
                text(x + width / 2, y + _ROW / 2 + 4, words, "middle", 11, "white" if strong else ON_LIGHT),
            ]
    height = top + _ROW * len(cells) + 12
    return document(
        _LABEL + width * len(events) + 12, height, "Paired change by source category and event", shapes
    )


def stale_histogram(report: Report) -> str:
    """Draw the number of pairs by number of stale actions before the next query."""
    stale = report.overall.stale_actions
    counts = {int(actions): pairs for actions, pairs in stale.histogram.items()}
    height, bottom = 150, 180
    most, last = max(counts.values(), default=1), max(counts, default=0)
    width = max(18.0, min(40.0, 560 / (last + 1)))
    shapes = [line(40, bottom, 40 + width * (last + 1), bottom, INK)]
    for actions in range(last + 1):
        pairs = counts.get(actions, 0)
        x, tall = 40 + width * actions, height * pairs / most
        shapes.append(rectangle(x + 2, bottom - tall, width - 4, tall, NEUTRAL))
        shapes.append(text(x + width / 2, bottom + 16, str(actions), "middle", 11, MUTED))
        if pairs:
            shapes.append(text(x + width / 2, bottom - tall - 4, str(pairs), "middle", 10, MUTED))
    shapes.append(text(40, bottom + 36, "stale actions before the next query", size=11, color=MUTED))
    across = max(260.0, 60 + width * (last + 1))
    return document(across, bottom + 48, "Stale-action exposure, pairs by actions", shapes)


def survival_curves(report: Report) -> str:
    """Draw the share of pairs not yet completed by policy step, a staircase for Base and one for Dynamic."""
    curves, left, high = report.success_curves, 50, 200
    last = curves.steps[-1] if curves else 0
    shapes = [text(left, high + 36, "policy steps", size=11, color=MUTED)]
    for quarter in range(5):
        y = high * (1 - quarter / 4)
        shapes += [
            line(left, y, left + _PLOT, y),
            text(left - 6, y + 4, f"{25 * quarter}%", "end", 11, MUTED),
        ]
    if curves and last:
        for quarter in range(5):
            x = left + _PLOT * quarter / 4
            shapes.append(text(x, high + 18, f"{last * quarter / 4:.0f}", "middle", 11, MUTED))
        arms = (("Base", curves.base, ARMS[0], 4), ("Dynamic", curves.dynamic, ARMS[1], 2))
        for number, (name, counts, color, width) in enumerate(arms):
            places = [
                (left + _PLOT * step / last, high * (1 - count / curves.pairs))
                for step, count in zip(curves.steps, counts, strict=True)
            ]
            x, y = left + _PLOT + 16, 12 + 18 * number
            shapes += [
                staircase(places, color, width),
                line(x, y, x + 24, y, color, width),
                text(x + 30, y + 4, name),
            ]
    return document(left + _PLOT + 110, high + 48, "Pairs not yet completed by policy step", shapes)


FIGURES: Mapping[str, Callable[[Report], str]] = {
    "base-to-dynamic": arrow_plot,
    "paired-change": change_profile,
    "categories": category_map,
    "stale-actions": stale_histogram,
    "time-to-success": survival_curves,
}
"""Every figure by the stem of its file name."""


def _label(name: str, block: Result, y: float) -> str:
    floor = " *" if block.floor else ""
    pairs = f"{block.played}/{block.planned}"
    same = block.played == block.planned
    return text(_LABEL - 10, y + 4, f"{name}{floor} ({block.played if same else pairs})", "end")


def _figure(rows: int, title: str, shapes: list[str]) -> str:
    return document(_LABEL + _PLOT + _NOTE, _TOP + _ROW * rows + 12, title, shapes)


def _share(value: float) -> float:
    return _LABEL + _PLOT * value


def _signed(value: float) -> float:
    return _LABEL + _PLOT * (value + 1) / 2


def _direction(value: float) -> str:
    return LOSS if value < 0 else GAIN if value > 0 else NEUTRAL
