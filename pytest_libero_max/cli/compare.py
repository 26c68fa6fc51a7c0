"""``libero-max compare``: runs side by side on the cases they share."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option, switch, whole_number
from pytest_libero_max.cli.comparisons import COMPARISONS, asked_comparison
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``compare`` to the parser."""
    compare = commands.add_parser(
        "compare", help="Compare runs on the cases they share, and list what flipped"
    )
    compare.add_argument(
        "folders", type=Path, nargs="*", metavar="FOLDER", help="The output folders of two or more runs"
    )
    switch(
        compare,
        "--restrict",
        "Compare on common cases where the runs have different ones, also with policies that support "
        "a part of the suites",
    )
    option(compare, "--flips N", "Listed at most", type=whole_number(0), default=20)
    option(compare, "--json FILE", "Also write the comparison here", type=Path)
    option(
        compare,
        "--output FOLDER",
        "Also write the comparison here as JSON, Markdown and HTML, with its figures",
        type=Path,
    )
    for way in COMPARISONS.values():
        way.add_options(compare)
    compare.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.comparison.compare import (
        common_cases,
        compare_runs,
        compared_and_apart,
        read_runs,
    )
    from pytest_libero_max.report.comparison.compare_files import write_comparison
    from pytest_libero_max.report.comparison.comparison_sections import comparison_lines
    from pytest_libero_max.report.writers.report_files import report_json, write_text

    way = asked_comparison(options)
    if way is not None and not way.compare(options):
        return
    runs = read_runs(options.folders)
    comparison = compare_runs(runs, options.restrict)
    if options.json:
        write_text(options.json, report_json(comparison))
    if options.output:
        compared, _ = compared_and_apart(runs, options.restrict)
        write_comparison(comparison, options.output, common_cases(compared, options.restrict))
    say(comparison_lines(comparison, options.flips))
