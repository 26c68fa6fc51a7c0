"""``libero-max compare --over-time``: several runs in their order, for example of checkpoints."""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.report.comparison.comparison_document import ComparedRun

_HEAD = ("run", "Base [95%]", "Dynamic [95%]", "change [95%]", "lost", "causes of what was lost")
_CAUSES = 3
"""Number of causes that are printed; the CSV has all."""


def compare_over_time(options: argparse.Namespace) -> None:
    """Print success and causes of several runs in their order, and write what the options ask for."""
    from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
    from pytest_libero_max.report.comparison.compare_text import caveat_lines, warning_lines, with_short_names
    from pytest_libero_max.report.formats import counted
    from pytest_libero_max.report.studies.study_figures import success_plot
    from pytest_libero_max.report.table import aligned
    from pytest_libero_max.report.writers.report_files import write_text

    if len(options.folders) < 2:
        raise OptionError("--over-time is of two or more runs. Give their folders in their order.")
    read = read_runs(options.folders)
    comparison = with_short_names(compare_runs(read, restrict=True))
    cases = {pair.item_id for pair in common_cases(read, restrict=True).planned}
    causes = [_causes(folder, cases) for folder in options.folders]
    pairs = comparison.pairs
    say(
        [
            f"{counted(len(causes), 'run')} on {counted(pairs.common, 'common case')}",
            *warning_lines(comparison),
            *caveat_lines(comparison),
            *aligned([_HEAD, *map(_row, comparison.runs, causes)]),
        ]
    )
    if options.csv:
        _write_csv(options.csv, comparison.runs, causes)
    if options.html:
        from pytest_libero_max.report.comparison.trend_html import trend_html

        write_text(options.html, trend_html(comparison, causes))
    if options.figure:
        names = [run.name for run in comparison.runs]
        base, dynamic = ([getattr(run, rate) for run in comparison.runs] for rate in _RATES)
        title = f"Success on {counted(pairs.common, 'common case')}"
        write_text(options.figure, success_plot(title, "run", names, base, dynamic))


_RATES = ("base_success", "dynamic_success")


def _causes(folder: Path, cases: set[str]) -> Counter[str]:
    """Count the causes of the regressions of a run among some cases."""
    from pytest_libero_max.report.diagnosis import changed_pairs
    from pytest_libero_max.runs.store import read_pairs

    changed = changed_pairs(record for record in read_pairs(folder).records if record.item_id in cases)
    return Counter(pair.cause for pair in changed if pair.outcome == "regression")


def _row(run: ComparedRun, causes: Counter[str]) -> tuple[str, ...]:
    from pytest_libero_max.report.formats import count_text, interval_text, percent, points

    rates = (getattr(run, rate) for rate in _RATES)
    change = run.paired_change
    return (
        run.name,
        *(f"{percent(rate.value)} {interval_text(rate)}" for rate in rates),
        f"{points(change.value)} {interval_text(change, signed=True)}",
        count_text(run.conditional_regression),
        ", ".join(f"{cause} {count}" for cause, count in causes.most_common(_CAUSES)),
    )


def _write_csv(file: Path, runs: Sequence[ComparedRun], causes: Sequence[Counter[str]]) -> None:
    """Write one line a run: shares as fractions, then the number of regressions of each cause."""
    every = sorted({cause for counted in causes for cause in counted})
    numbers = [f"{rate}{end}" for rate in (*_RATES, "paired_change") for end in ("", "_lower", "_upper")]
    with file.open("w", newline="", encoding="utf-8") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(("run", *numbers, "lost", "of", *every))
        for run, counted in zip(runs, causes, strict=True):
            estimates = [getattr(run, name) for name in (*_RATES, "paired_change")]
            ends = [value for one in estimates for value in (one.value, one.lower, one.upper)]
            lost = run.conditional_regression
            writer.writerow((run.name, *ends, lost.count, lost.of, *(counted[cause] for cause in every)))
