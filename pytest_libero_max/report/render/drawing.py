"""Plots as standalone SVG documents."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch

from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.palette import ARMS, BOX, GRID, INK, LIGHT, MUTED, NEUTRAL, ON_LIGHT
from pytest_libero_max.report.plots import (
    OUTCOME_KINDS,
    Axis,
    Bars,
    Drawable,
    HeatMap,
    Histogram,
    Plot,
    Row,
    Scatter,
)
from pytest_libero_max.report.render.svg import (
    circle,
    document,
    labelled_lines,
    line,
    rectangle,
    shade,
    staircase,
    text,
)
from pytest_libero_max.report.report_document import SuccessCurves
from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE

_ROW, _TOP, _PLOT, _MARGIN = 26, 34, 420, 12
_LANE = 7
"""Height of a run within a row that several share."""
_LETTER = 6.8
"""Mean width of a letter of 12 pixels."""


@singledispatch
def drawn(plot: Drawable) -> str:
    """Return a plot as an SVG document."""
    raise TypeError(f"{plot!r} is no plot.")


@drawn.register
def _plot(plot: Plot) -> str:
    left = 2 * _MARGIN + _LETTER * max((len(_label(row)) for row in plot.rows), default=0)
    lanes = len(plot.legend) > 2
    height = _LANE * len(plot.legend) + 18 if lanes else _ROW
    bottom = _TOP + height * len(plot.rows)

    def place(value: float) -> float:
        return left + _PLOT * plot.axis.at(value) / 100

    ticks = [(left + _PLOT * at / 100, words + "%" * (not plot.signed)) for at, words in plot.axis.ticks]
    shapes = [*labelled_lines(ticks, _TOP, bottom), line(place(0), _TOP, place(0), bottom, INK)]
    for index, row in enumerate(plot.rows):
        begin = _TOP + height * index
        y = begin + height / 2
        shapes.append(text(left - _MARGIN, y + 4, _label(row), "end"))
        if row.box is not None:
            lower, median, upper = map(place, row.box)
            shapes += [
                rectangle(lower, begin + 5, max(upper - lower, 1), height - 10, BOX),
                line(median, begin + 5, median, begin + height - 5, INK, 2),
            ]
        if row.span is not None:
            first, second, kind = row.span
            shapes.append(line(place(first), y, place(second), y, LIGHT[kind], 2.5))
        for lane, (value, kind) in enumerate(row.dots):
            down = begin + 9 + _LANE * (lane + 0.5) if lanes else y
            # The first of two is seen below an equal second one.
            shapes.append(_dot(place(value), down, kind, 7 if len(row.dots) == 2 and lane == 0 else 5))
        shapes.append(text(left + _PLOT + 16, y + 4, row.text, color=MUTED))
    shapes += _legend(plot.legend, bottom)
    bottom += 18 * len(plot.legend)
    if plot.note:
        bottom += 18
        shapes.append(text(_MARGIN, bottom + 4, plot.note, size=11, color=MUTED))
    width = left + _PLOT + 28 + _LETTER * max((len(row.text) for row in plot.rows), default=0)
    return document(width, bottom + _MARGIN, plot.title, shapes)


def _label(row: Row) -> str:
    return f"{row.name} ({row.note})" if row.note else str(row.name)


def _dot(x: float, y: float, kind: str, radius: float = 5) -> str:
    name, _, ring = kind.partition(" ")
    return circle(x, y, radius, *(("white", LIGHT[name]) if ring else (LIGHT[name],)))


def _legend(legend: Sequence[tuple[str, str]], bottom: float) -> list[str]:
    shapes = []
    for number, (kind, name) in enumerate(legend):
        y = bottom + 22 + 18 * number
        shapes += [_dot(_MARGIN + 6, y - 4, kind, 4.5), text(_MARGIN + 18, y, name)]
    return shapes


@drawn.register
def _bars(plot: Bars) -> str:
    left = 2 * _MARGIN + _LETTER * max(len(name) for name, _ in plot.rows)
    shapes, x = [], left
    for part in plot.rows[0][1]:
        color = LIGHT[OUTCOME_KINDS[part.outcome]]
        shapes += [rectangle(x, 10, 12, 12, color), text(x + 17, 20, part.title, size=11)]
        x += 34 + 6.2 * len(part.title)
    width = max(2 * _PLOT / 1.25, x - left)
    for index, (name, parts) in enumerate(plot.rows):
        y, begin = 40 + _ROW * index, left
        shapes.append(text(left - _MARGIN, y + _ROW / 2 + 4, name, "end"))
        for part in parts:
            long = width * part.width / 100
            shapes.append(rectangle(begin, y + 2, long, _ROW - 4, LIGHT[OUTCOME_KINDS[part.outcome]]))
            if long > 36:
                dark = part.outcome in ("preserved_success", "regression")
                words = percent(part.width / 100)
                color = "white" if dark else ON_LIGHT
                shapes.append(text(begin + long / 2, y + _ROW / 2 + 4, words, "middle", 11, color))
            begin += long
    return document(left + width + _MARGIN, 40 + _ROW * len(plot.rows) + _MARGIN, plot.title, shapes)


@drawn.register
def _heat_map(plot: HeatMap) -> str:
    left, width, top = 220, 84, 58
    shapes: list[str] = []
    for column, name in enumerate(plot.columns):
        first, _, second = name.partition("_")
        x = left + width * (column + 0.5)
        shapes += [text(x, 24, first, "middle"), text(x, 40, second.replace("_", " "), "middle", 11, MUTED)]
    for row, (group, cells) in enumerate(plot.rows):
        y = top + _ROW * row
        shapes.append(text(left - 10, y + _ROW / 2 + 4, group.text, "end"))
        for column, cell in enumerate(cells):
            x = left + width * column
            if cell is None:
                shapes.append(rectangle(x + 1, y + 1, width - 2, _ROW - 2, GRID))
                continue
            color = "white" if abs(cell.change) > 0.3 else ON_LIGHT
            words = f"{points(cell.change)} ({cell.pairs})"
            shapes += [
                rectangle(x + 1, y + 1, width - 2, _ROW - 2, shade(cell.change)),
                text(x + width / 2, y + _ROW / 2 + 4, words, "middle", 11, color),
            ]
    height = top + _ROW * len(plot.rows) + _MARGIN
    return document(left + width * len(plot.columns) + _MARGIN, height, plot.title, shapes)


@drawn.register
def _histogram(plot: Histogram) -> str:
    high, bottom, bars = 150, 180, plot.bars
    width = max(18.0, min(40.0, 560 / len(bars)))
    shapes = [line(40, bottom, 40 + width * len(bars), bottom, INK)]
    for number, (label, count, share) in enumerate(bars):
        x, tall = 40 + width * number, high * share / 100
        shapes.append(rectangle(x + 2, bottom - tall, width - 4, tall, NEUTRAL))
        shapes.append(text(x + width / 2, bottom + 16, label, "middle", 11, MUTED))
        if count:
            shapes.append(text(x + width / 2, bottom - tall - 4, str(count), "middle", 10, MUTED))
    shapes.append(text(40, bottom + 36, plot.axis, size=11, color=MUTED))
    return document(max(260.0, 60 + width * len(bars)), bottom + 48, plot.title, shapes)


@drawn.register
def _scatter(plot: Scatter) -> str:
    width, height, gap, left, top = 300, 240, 40, 60, 34
    axis = Axis(change for points in plot.panels.values() for _, change, _ in points)

    def down(value: float) -> float:
        return top + height * (1 - axis.at(value) / 100)

    shapes: list[str] = []
    for number, (title, panel) in enumerate(plot.panels.items()):
        begin = left + number * (width + gap)
        # Base success is too low to fall in the grey part.
        shapes += [rectangle(begin, top, width * FLOOR_BASE_RATE, height, BOX), text(begin, top - 14, title)]
        for tick in range(0, 101, 20):
            x = begin + width * tick / 100
            shapes.append(line(x, top, x, top + height))
            shapes.append(text(x, top + height + 16, f"{tick}%", "middle", 11, MUTED))
        for at, words in axis.ticks:
            y = top + height * (1 - at / 100)
            shapes.append(line(begin, y, begin + width, y, INK if words == "0" else GRID))
            if number == 0:
                shapes.append(text(left - 8, y + 4, words, "end", 11, MUTED))
        shapes += [_dot(begin + width * base, down(change), kind, 3.5) for base, change, kind in panel]
    bottom = top + height + 34
    shapes.append(text(left, bottom, plot.axis, size=11, color=MUTED))
    shapes += _legend(plot.legend, bottom)
    across = max(left + len(plot.panels) * (width + gap), 560)
    return document(across, bottom + 22 + 18 * len(plot.legend), plot.title, shapes)


def survival_curves(curves: SuccessCurves | None) -> str:
    """Draw the share of pairs not yet completed by policy step, a staircase for Base and one for Dynamic."""
    left, high = 50, 200
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
