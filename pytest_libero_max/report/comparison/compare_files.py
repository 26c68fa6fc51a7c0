"""The files of a comparison: JSON, Markdown, figures, and a page that needs no network."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlencode

from msgspec.structs import replace

from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import document_of, with_short_names
from pytest_libero_max.report.formats import interval_text, points
from pytest_libero_max.report.page.comparison_cases import beside, comparison_cases
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.plots import (
    COLOURS_NOTE,
    Bars,
    Drawable,
    Plot,
    Row,
    Viewed,
    change_row,
    direction,
    outcome_bar,
    run_kind,
)
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.writers.report_files import make_folder, report_json, write_drawings, write_text
from pytest_libero_max.runs.store import pairs_file

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


COMPARISON_CAPTIONS = {stem: caption for stem, (_, caption) in COMPARISON_PLOTS.items()}
"""Captions of the figures."""


def write_comparison(comparison: Comparison, folder: Path, common: CommonCases | None = None) -> list[Path]:
    """Write ``comparison.json``, ``comparison.md``, ``comparison.html`` and the figures.

    Args:
        folder: Made where it is missing.
        common: The cases that were compared, of runs named by their paths. The page then has a table of
            them, shows their films, and links to the pages of the runs.

    Returns:
        The files. The figures are SVG, and PNG as well where the extra ``figures`` is installed.
    """
    files = {
        "comparison.json": report_json(comparison),
        "comparison.md": comparison_markdown(comparison),
        "comparison.html": comparison_html(comparison, common, folder),
    }
    make_folder(folder)
    for name, content in files.items():
        write_text(folder / name, content)
    return [*(folder / name for name in files), *write_drawings(comparison_figures(comparison), folder)]


def comparison_markdown(comparison: Comparison) -> str:
    """Return a comparison as Markdown, with the figures beside it."""
    return document_markdown(document_of(comparison), COMPARISON_CAPTIONS)


def comparison_figures(comparison: Comparison) -> dict[str, str]:
    """Return the SVG documents of a comparison by the stem of their file name, its runs named briefly."""
    shown = with_short_names(replace(comparison, flips=[]))
    return {stem: drawn(plot(shown)) for stem, (plot, _) in COMPARISON_PLOTS.items()}


def comparison_html(
    comparison: Comparison, common: CommonCases | None = None, folder: Path | None = None
) -> str:
    """Render a comparison as a page.

    Args:
        common: The cases that were compared, of runs named by their paths; None leaves their table out.
        folder: Folder of the page; by default the working directory.
    """
    shown = with_short_names(replace(comparison, flips=[]))
    cases = None
    if common is not None:
        names = [run.name for run in comparison.runs]
        cases = comparison_cases(
            common,
            dict(zip(names, (run.name for run in shown.runs), strict=True)),
            {run.name: run.replay for run in comparison.runs},
            beside({name: pairs_file(Path(name)).parent for name in names}, folder or Path()),
        )
    return document_page(
        "comparison.html",
        document_of(comparison),
        cases,
        headline=_headline(shown) if len(shown.runs) == 2 else None,
        plot=success_differences(shown) if len(shown.runs) == 2 else event_changes(shown),
        colours_note=COLOURS_NOTE,
        shares=outcome_shares(shown).rows,
        events=[] if common is None else events_of(common.planned),
    )


def _headline(comparison: Comparison) -> tuple[str, str, str, str]:
    """Return the difference of two runs in Dynamic success: number, interval, class of its colour, words."""
    (contrast,) = comparison.contrasts
    difference = contrast.difference
    kind = direction(difference)
    words = {
        "loss": f"{contrast.second} succeeds less often than {contrast.first} when the event happens.",
        "gain": f"{contrast.second} succeeds more often than {contrast.first} when the event happens.",
        "neutral": "No difference is shown: the interval holds 0.",
    }
    return f"{points(difference.value)} pp", interval_text(difference, signed=True), kind, words[kind]
