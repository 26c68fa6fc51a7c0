"""``libero-max compare --over-time``: several runs in their order, for example of checkpoints."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import option, switch
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

OPTIONS = ("csv", "html", "figure")
TAKES = ("restrict",)


def add_options(compare: argparse.ArgumentParser) -> None:
    """Add ``--over-time`` and what belongs to it."""
    switch(
        compare,
        "--over-time",
        "Follow success and causes over the runs in the order given, for example of checkpoints, on the "
        "cases that all have measured. Intervals are of each run alone",
    )
    option(compare, "--csv FILE", "With --over-time: also write the numbers here", type=Path)
    option(compare, "--html FILE", "With --over-time: also write a page with charts here", type=Path)
    option(compare, "--figure FILE", "With --over-time: also draw success by run here, as SVG", type=Path)


def compare(options: argparse.Namespace) -> bool:
    """Print success and causes of several runs in their order, and write what the options ask for."""
    from pytest_libero_max.lab.comparisons.trend import (
        causes_of,
        success_by_run,
        trend_html,
        trend_of,
        trend_table,
    )
    from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
    from pytest_libero_max.report.comparison.comparison_sections import terminal_head, with_short_names
    from pytest_libero_max.report.render.drawing import drawn
    from pytest_libero_max.report.render.tables import table_csv
    from pytest_libero_max.report.render.terminal import table_lines
    from pytest_libero_max.report.writers.report_files import write_text

    if len(options.folders) < 2:
        raise OptionError("--over-time is of two or more runs. Give their folders in their order.")
    read = read_runs(options.folders)
    comparison = with_short_names(compare_runs(read, restrict=True))
    cases = {pair.item_id for pair in common_cases(read, restrict=True).planned}
    causes = [causes_of(folder, cases) for folder in options.folders]
    lines = table_lines(trend_table(comparison, causes, whole=False), short=False, numbers=False)
    say([*terminal_head(trend_of(comparison, causes), comparison), *lines])
    if options.csv:
        write_text(options.csv, table_csv(trend_table(comparison, causes, whole=True)))
    if options.html:
        write_text(options.html, trend_html(comparison, causes))
    if options.figure:
        write_text(options.figure, drawn(success_by_run(comparison)))
    return False
