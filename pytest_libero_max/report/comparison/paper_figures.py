"""Figures of policies beside each other: arrows from Base to Dynamic, panels, and source categories."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pytest_libero_max.report.comparison.compare_figures import distinct_colors
from pytest_libero_max.report.comparison.paper_rows import PolicyRow, Rates
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.palette import BOX, GAIN, GRID, INK, LOSS, MUTED, NEUTRAL
from pytest_libero_max.report.writers.svg import (
    arrow,
    circle,
    document,
    labelled_lines,
    line,
    rectangle,
    text,
)
from pytest_libero_max.stats.outcome_table import FLOOR_BASE_RATE

_ROW, _LABEL, _PLOT, _NOTE, _TOP = 24, 190, 440, 190, 34


def policy_arrows(rows: Sequence[PolicyRow]) -> str | None:
    """Success of every policy: a ring for Base, an arrow to Dynamic."""
    bottom = _TOP + _ROW * len(rows)

    def place(share: float) -> float:
        return _LABEL + _PLOT * share

    shapes = labelled_lines([(place(tick / 100), f"{tick}%") for tick in range(0, 101, 20)], _TOP, bottom)
    for index, row in enumerate(rows):
        y = _TOP + _ROW * (index + 0.5)
        rates = Rates.of(row.outcomes)
        shapes.append(text(_LABEL - 10, y + 4, row.name, "end"))
        if rates.base is None or rates.dynamic is None or rates.change is None:
            continue
        color = LOSS if rates.change < 0 else GAIN if rates.change else NEUTRAL
        note = f"{percent(rates.base)} to {percent(rates.dynamic)}, {points(rates.change)}"
        shapes += [
            arrow(place(rates.base), place(rates.dynamic), y, color),
            circle(place(rates.base), y, 5, "white", INK),
            text(_LABEL + _PLOT + 16, y + 4, note, size=11, color=MUTED),
        ]
    return document(_LABEL + _PLOT + _NOTE, bottom + 12, "Base to Dynamic success by policy", shapes)


_PANELS: tuple[tuple[str, Callable[[PolicyRow], float | None]], ...] = (
    ("retained", lambda row: row.outcomes.retained.value),
    ("Base successes lost", lambda row: row.outcomes.conditional_regression.value),
    ("event fired", lambda row: None if row.trigger is None else row.trigger.value),
    ("query after it", lambda row: None if row.response is None else row.response.value),
)


def panels(rows: Sequence[PolicyRow]) -> str | None:
    """Draw a panel each for retained performance, lost Base successes, and both coverages."""
    known = [(title, [of(row) for row in rows]) for title, of in _PANELS]
    known = [(title, values) for title, values in known if any(value is not None for value in values)]
    if not known:
        return None
    width, gap = 150, 52
    bottom = _TOP + _ROW * len(rows)
    shapes = [
        text(_LABEL - 10, _TOP + _ROW * (index + 0.5) + 4, row.name, "end") for index, row in enumerate(rows)
    ]
    for number, (title, values) in enumerate(known):
        left = _LABEL + number * (width + gap)
        longest = max(1.0, *(value or 0.0 for value in values))
        shapes += [text(left, _TOP - 12, title), line(left, _TOP, left, bottom, INK)]
        for index, value in enumerate(values):
            y = _TOP + _ROW * (index + 0.5)
            if value is None:
                shapes.append(text(left + 6, y + 4, "not published", size=11, color=MUTED))
                continue
            long = width * value / longest
            shapes += [
                rectangle(left, y - 7, long, 14, LOSS if title == "Base successes lost" else NEUTRAL),
                text(left + long + 5, y + 4, percent(value), size=11, color=MUTED),
            ]
    title = "Retained performance, lost Base successes and coverage by policy"
    return document(_LABEL + len(known) * (width + gap) + 10, bottom + 12, title, shapes)


def category_scatter(rows: Sequence[PolicyRow]) -> str | None:
    """Draw Base success and paired change of every policy in every source category, a panel a source."""
    shown = [row for row in rows if row.by.get("category")]
    if not shown:
        return None
    colors = distinct_colors(len(shown))[: len(shown)]
    sources = list(shown[0].by["source"])
    changes = [rates.change or 0.0 for row in shown for rates in row.by["category"].values()]
    lowest, highest = (round(end(changes), 1) for end in (min, max))
    low, high = min(lowest - 0.05, -0.1), max(highest + 0.05, 0.1)
    width, height, gap, left, top = 300, 240, 40, 60, 34

    def down(change: float) -> float:
        return top + height * (high - change) / (high - low)

    shapes: list[str] = []
    for number, source in enumerate(sources):
        begin = left + number * (width + gap)
        shapes += [
            rectangle(begin, top, width * FLOOR_BASE_RATE, height, BOX),
            text(begin, top - 14, source),
        ]
        for tick in range(0, 101, 20):
            x = begin + width * tick / 100
            shapes += [
                line(x, top, x, top + height),
                text(x, top + height + 16, f"{tick}%", "middle", 11, MUTED),
            ]
        for tick in range(round(low * 10), round(high * 10) + 1, 2 if high - low > 0.6 else 1):
            if not low <= tick / 10 <= high:
                continue
            y = down(tick / 10)
            shapes.append(line(begin, y, begin + width, y, INK if tick == 0 else GRID))
            if number == 0:
                shapes.append(text(left - 8, y + 4, f"{10 * tick:+d}" if tick else "0", "end", 11, MUTED))
        for row, color in zip(shown, colors, strict=True):
            for name, rates in row.by["category"].items():
                if name.partition("-")[0] == source and None not in (rates.base, rates.change):
                    shapes.append(
                        circle(begin + width * (rates.base or 0), down(rates.change or 0), 3.5, color)
                    )
    bottom = top + height + 34
    shapes.append(text(left, bottom, "Base success; a point is a source category", size=11, color=MUTED))
    for index, (row, color) in enumerate(zip(shown, colors, strict=True)):
        y = bottom + 22 + 18 * index
        shapes += [circle(left + 6, y - 4, 4.5, color), text(left + 18, y, row.name)]
    across = max(left + len(sources) * (width + gap), 560)
    title = "Paired change in percentage points by Base success, source categories"
    return document(across, bottom + 22 + 18 * len(shown), title, shapes)


PAPER_FIGURES: Mapping[str, tuple[Callable[[Sequence[PolicyRow]], str | None], str]] = {
    "policy-arrows": (policy_arrows, "Base success (ring) and Dynamic success (head of the arrow)."),
    "panels": (
        panels,
        "Dynamic successes per Base success, Base successes that fail in Dynamic, pairs whose event fired, "
        "and pairs with a query after it.",
    ),
    "categories": (
        category_scatter,
        "Base success and paired change by source category. In the grey part Base success is below 20%: a "
        "small change says nothing about robustness there.",
    ),
}
"""Figures by the stem of their file name, each with its caption. None where nothing is known to draw."""
