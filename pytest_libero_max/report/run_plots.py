"""The plots of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from urllib.parse import urlencode

from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.report.formats import Estimate, count_text, interval_text, percent, points
from pytest_libero_max.report.groups import FLOOR_MARK, FLOOR_NOTE
from pytest_libero_max.report.plots import (
    Drawable,
    Heat,
    HeatMap,
    Histogram,
    Plot,
    Viewed,
    change_row,
    rates_row,
)
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Result


def forest(report: Report) -> Plot:
    """Return the paired change of all pairs and of the events, the lowest first, with their intervals."""
    events = report.by["event"].items()
    shown = sorted(events, key=lambda item: (item[1].paired_change.value or 0.0, item[0]))
    rows = [
        change_row(_name(name, row), _pairs(row), row.paired_change, _lost_and_change(row))
        for name, row in [("all pairs", report.overall), *shown]
    ]
    interval = " [95%]" if any(row.span for row in rows) else ""
    return Plot(
        "Paired change in percentage points by event",
        ("Event (pairs)", f"Lost of Base successes, change in pp{interval}"),
        rows,
        note=_floor_note(report),
    )


def base_to_dynamic(report: Report) -> Plot:
    """Return success rates in Base and Dynamic, one row an event and one for all pairs."""
    rows = []
    for name, row in {"all pairs": report.overall, **report.by["event"]}.items():
        base, dynamic = row.base_success.value, row.dynamic_success.value
        text = f"{percent(base)} to {percent(dynamic)}"
        rows.append(rates_row(_name(name, row), _pairs(row), base, dynamic, text))
    head = ("Event (pairs)", "Base to Dynamic")
    title, note = "Base to Dynamic success by event", _floor_note(report)
    return Plot(title, head, rows, signed=False, note=note)


def category_map(report: Report) -> HeatMap:
    """Return the paired change of every source category under every event."""
    events = [event for event in EVENTS if event in report.by["event"]]
    rows = []
    for category, cells in report.category_by_event.items():
        changes = {event: cell.paired_change for event, cell in cells.items()}
        row = [
            Heat(change.value, change.of, urlencode({"category": category, "event": event}))
            if (change := changes.get(event)) is not None and change.value is not None
            else None
            for event in events
        ]
        rows.append((Viewed(category, urlencode({"category": category})), row))
    return HeatMap("Paired change by source category and event", events, rows)


def stale_actions(report: Report) -> Histogram:
    """Return the number of pairs by number of stale actions."""
    return Histogram.of(
        "Stale-action exposure, pairs by actions",
        "stale actions before the next query",
        report.overall.stale_actions.histogram,
    )


RUN_PLOTS: Mapping[str, Callable[[Report], Drawable]] = {
    "base-to-dynamic": base_to_dynamic,
    "paired-change": forest,
    "categories": category_map,
    "stale-actions": stale_actions,
}
"""Plots that are files as well, by the stem of their name."""


def _name(name: str, row: Result) -> Viewed:
    view = "" if name == "all pairs" else urlencode({"event": name})
    return Viewed(f"{name}{FLOOR_MARK * bool(row.floor)}", view)


def _floor_note(report: Report) -> str:
    rows = [report.overall, *report.by["event"].values()]
    return FLOOR_NOTE if any(row.floor for row in rows) else ""


def _pairs(row: Result) -> str:
    return str(row.played) if row.played == row.planned else f"{row.played}/{row.planned}"


def _lost_and_change(row: Result) -> str:
    """Return the lost Base successes as counts, the gains where there are some, and the paired change."""
    if not row.played:
        return _change(row.paired_change)
    gains = row.outcomes.change_associated_success
    lost = f"{count_text(row.conditional_regression)} lost{f', {gains} gained' if gains else ''}"
    return f"{lost}, {_change(row.paired_change)}"


def _change(change: Estimate) -> str:
    return "n/a" if change.value is None else f"{points(change.value)} {interval_text(change, signed=True)}"
