"""The page of a comparison: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import document_of, with_short_names
from pytest_libero_max.report.formats import interval_text, points
from pytest_libero_max.report.page.charts import RUN_COLOURS, direction, outcome_bar, runs_by_event
from pytest_libero_max.report.page.comparison_cases import beside, comparison_cases
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.runs.store import pairs_file


def comparison_html(
    comparison: Comparison, common: CommonCases | None = None, folder: Path | None = None
) -> str:
    """Render a comparison as a page.

    Args:
        comparison: Result of :func:`~pytest_libero_max.report.comparison.compare.compare_runs`.
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
        plot=runs_by_event(shown),
        colours=[(f"run{number % RUN_COLOURS}", run.name) for number, run in enumerate(shown.runs)],
        shares=[(run.name, outcome_bar(run.outcomes)) for run in shown.runs],
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
