"""The page of a comparison: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlencode

from msgspec.structs import replace

from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.compare_tables import APART, EVENT, apart_tables, contrast_tables
from pytest_libero_max.report.comparison.compare_text import (
    OPEN_RANKS,
    comparison_title,
    comparison_warnings,
    rank_set_text,
    rank_text,
    with_short_names,
)
from pytest_libero_max.report.comparison.comparison_document import ComparedRun, Comparison
from pytest_libero_max.report.comparison.run_notes import CAVEATS_TITLE, caveats_by_run
from pytest_libero_max.report.formats import change_text, count_text, interval_text, points, rate_text
from pytest_libero_max.report.page.charts import RUN_COLOURS, direction, outcome_bar, runs_by_event
from pytest_libero_max.report.page.comparison_cases import beside, comparison_cases
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import Viewed, page
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.table import Table
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
    return page(
        "comparison.html",
        comparison_title(comparison),
        cases,
        substrate_note=comparison.substrate.note,
        warnings=comparison_warnings(shown),
        caveats_title=CAVEATS_TITLE,
        caveats=caveats_by_run(shown),
        runs=[_run_row(run) for run in sorted(shown.runs, key=_rank)],
        open_ranks=OPEN_RANKS,
        apart_note=APART,
        apart=apart_tables(shown.apart),
        headline=_headline(shown) if len(shown.runs) == 2 else None,
        plot=runs_by_event(shown),
        colours=[(f"run{number % RUN_COLOURS}", run.name) for number, run in enumerate(shown.runs)],
        shares=[(run.name, outcome_bar(run.outcomes)) for run in shown.runs],
        contrasts=[(table, _rows(table)) for table in contrast_tables(shown)],
        events=[] if common is None else events_of(common.planned),
        limits_title=LIMITS_TITLE,
        statements=comparison.statements.values(),
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


def _rows(table: Table) -> Sequence[Sequence[Viewed | str]]:
    """Return the rows of a table; the name of an event leads to its cases."""
    if table.head[0] != EVENT:
        return table.rows
    return [(Viewed(event, urlencode({"event": event})), *cells) for event, *cells in table.rows]


def _run_row(run: ComparedRun) -> tuple[str, ...]:
    return (
        run.name,
        rank_text(run),
        rank_set_text(run),
        rate_text(run.base_success),
        rate_text(run.dynamic_success),
        change_text(run.paired_change),
        count_text(run.conditional_regression),
    )


def _rank(run: ComparedRun) -> float:
    return float("inf") if run.rank is None else run.rank
