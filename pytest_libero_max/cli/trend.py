"""``libero-max trend``: several runs in their order, for example of checkpoints, one line each."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError


def add_command(commands: Commands) -> None:
    """Add ``trend`` to the parser."""
    trend = commands.add_parser(
        "trend",
        help="Follow success and causes over several runs, for example of checkpoints, in the order given",
        description="All numbers are over the cases that every run has measured. Intervals are of each run "
        "alone; libero-max compare has the paired contrasts of two.",
    )
    trend.add_argument("folders", type=Path, nargs="+", metavar="RUN", help="Folders of two or more runs")
    option(trend, "--csv FILE", "Also write the numbers here", type=Path)
    option(trend, "--html FILE", "Also write a page with charts here", type=Path)
    option(trend, "--figure FILE", "Also draw success by run here, as SVG", type=Path)
    trend.set_defaults(run=_trend)


def _trend(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
    from pytest_libero_max.report.comparison.comparison_sections import terminal_head, with_short_names
    from pytest_libero_max.report.comparison.trend import causes_of, trend_html, trend_of, trend_table
    from pytest_libero_max.report.formats import counted
    from pytest_libero_max.report.render.tables import table_csv
    from pytest_libero_max.report.render.terminal import table_lines
    from pytest_libero_max.report.studies.study_figures import success_plot
    from pytest_libero_max.report.writers.report_files import write_text

    if len(options.folders) < 2:
        raise OptionError.seen("RUN", options.folders[0], ", but a trend is of two or more runs.")
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
        names = [run.name for run in comparison.runs]
        base = [run.base_success for run in comparison.runs]
        dynamic = [run.dynamic_success for run in comparison.runs]
        title = f"Success on {counted(comparison.pairs.common, 'common case')}"
        write_text(options.figure, success_plot(title, "run", names, base, dynamic))
