"""The plots of several runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple
from urllib.parse import urlencode

from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.formats import interval_text, points
from pytest_libero_max.report.plots import (
    Bars,
    Drawable,
    Plot,
    Row,
    Viewed,
    change_row,
    outcome_bar,
    run_kind,
)

_LEAST_BOXED = 5
"""Number of runs from which on median, quartiles and range say something of them."""


def event_changes(comparison: Comparison) -> Plot:
    """Return the paired changes of runs by event: a dot a run, and for two runs the line between them."""
    runs = comparison.runs
    rows = []
    for event, over_runs in comparison.events.items():
        values = [run.by_event[event].value or 0.0 for run in runs]
        text, span, box = f"{points(over_runs.lowest)} to {points(over_runs.highest)}", None, None
        if len(runs) == 2:
            first, second = values
            text = f"{points(first)} to {points(second)}"
            span = (first, second, "loss" if second < first else "gain") if first != second else None
        elif len(runs) >= _LEAST_BOXED:
            box = (over_runs.lower_quartile, over_runs.median, over_runs.upper_quartile)
            span = (over_runs.lowest, over_runs.highest, "neutral")
            text = f"{points(box[1])} [{points(box[0])}, {points(box[2])}]"
        dots = [(value, run_kind(number)) for number, value in enumerate(values)]
        rows.append(Row(Viewed(event, urlencode({"event": event})), "", text, dots, span, box))
    numbers = "First to second, pp" if len(runs) == 2 else "Lowest to highest, pp"
    if len(runs) >= _LEAST_BOXED:
        numbers = "Median [quartiles], pp"
    legend = [(run_kind(number), run.name) for number, run in enumerate(runs)]
    return Plot("Paired change by event, percentage points", ("Event", numbers), rows, legend)


class _Difference(NamedTuple):
    """A difference with an interval that holds together with those of the other events."""

    value: float | None
    lower: float | None
    upper: float | None


def success_differences(comparison: Comparison) -> Plot:
    """Return Dynamic success of the second of two runs less that of the first, by event."""
    rows = []
    for event, contrasts in comparison.by_event.items():
        (contrast,) = contrasts.dynamic_success
        simultaneous = contrast.difference.simultaneous
        difference = _Difference(contrast.difference.value, simultaneous.lower, simultaneous.upper)
        text = f"{points(difference.value)} {interval_text(simultaneous, signed=True)}"
        name = Viewed(event, urlencode({"event": event}))
        rows.append(change_row(name, str(contrast.cases), difference, text))
    first, second = (run.name for run in comparison.runs)
    title = f"Dynamic success of {second} less that of {first}, by event"
    return Plot(title, ("Event (cases)", "pp [simultaneous 95%]"), rows)


def outcome_shares(comparison: Comparison) -> Bars:
    """Return the four outcomes (Base, Dynamic) as shares of the common cases, a bar for every run."""
    return Bars(
        "Outcomes (Base, Dynamic), shares of the cases",
        [(run.name, outcome_bar(run.outcomes)) for run in comparison.runs],
    )


COMPARISON_PLOTS: Mapping[str, tuple[Callable[[Comparison], Drawable], str]] = {
    "event-changes": (
        event_changes,
        "Paired change by event in percentage points. A dot is a run. The line between two runs is red where "
        "the second loses more, blue where it loses less. From five runs on the line is their range, the box "
        "reaches from the lower to the upper quartile, and the bar in it is the median.",
    ),
    "outcome-shares": (
        outcome_shares,
        "Outcomes of the pairs (Base, Dynamic) of every run, as shares of the common cases.",
    ),
}
"""Plots of a comparison that are files as well, by the stem of their name, each with its caption."""
