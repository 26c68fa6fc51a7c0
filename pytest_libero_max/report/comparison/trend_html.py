"""The page of several runs in their order: one file that needs neither a network nor a script."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pytest_libero_max.report.comparison.compare_text import comparison_warnings
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.run_notes import CAVEATS_TITLE, caveats_by_run
from pytest_libero_max.report.formats import (
    change_text,
    count_text,
    counted,
    interval_text,
    points,
    rate_text,
)
from pytest_libero_max.report.page.charts import direction, over_runs
from pytest_libero_max.report.page.page_frame import page
from pytest_libero_max.report.statements import LIMITS_TITLE


def trend_html(comparison: Comparison, causes: Sequence[Counter[str]]) -> str:
    """Render runs as a page: paired change and success over the runs, and the causes of what each lost.

    Args:
        comparison: The runs in their order, on the cases that all have measured.
        causes: For each run the number of its regressions by cause.
    """
    runs = comparison.runs
    named = [f"{number} {run.name}" for number, run in enumerate(runs, 1)]
    every = sorted(
        {cause for counted in causes for cause in counted}, key=lambda cause: (-_all(cause, causes), cause)
    )
    first, last = runs[0].paired_change, runs[-1].paired_change
    return page(
        "trend.html",
        f"Trend of {counted(len(runs), 'run')} on {counted(comparison.pairs.common, 'common case')}",
        None,
        substrate_note=comparison.substrate.note,
        warnings=comparison_warnings(comparison),
        caveats_title=CAVEATS_TITLE,
        caveats=caveats_by_run(comparison),
        last=(runs[-1].name, f"{points(last.value)} pp", interval_text(last, signed=True), direction(last)),
        first=(runs[0].name, change_text(first)),
        change=over_runs({"": [run.paired_change for run in runs]}, signed=True),
        success=over_runs(
            {"arm0": [run.base_success for run in runs], "arm1": [run.dynamic_success for run in runs]}
        ),
        runs=[
            (name, *map(rate_text, (run.base_success, run.dynamic_success)), change_text(run.paired_change))
            for name, run in zip(named, runs, strict=True)
        ],
        causes_head=("Run", "Base successes lost", *(cause.replace("_", " ") for cause in every)),
        causes=[
            (name, count_text(run.conditional_regression), *(counted[cause] for cause in every))
            for name, run, counted in zip(named, runs, causes, strict=True)
        ],
        limits_title=LIMITS_TITLE,
        statements=comparison.statements.values(),
    )


def _all(cause: str, causes: Sequence[Counter[str]]) -> int:
    return sum(counted[cause] for counted in causes)
