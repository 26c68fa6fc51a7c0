"""``libero-max compare``: runs side by side on the cases they share."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, option, switch, whole_number
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.runs.outcomes import RunOutcomes


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
    option(
        compare,
        "--tables FOLDER",
        "Also write the tables and figures that the paper prints here, for these runs or for one: "
        "Markdown, CSV and LaTeX",
        type=Path,
    )
    switch(compare, "--published", "Add the published results to the tables; without a run, write them alone")
    switch(
        compare,
        "--by-cell",
        "Of two runs of one policy on different cases, the old ones first: success on the old less that "
        "on the new ones within cells (source, event, variant), which tells over-fitting from ability",
    )
    switch(
        compare,
        "--over-time",
        "Follow success and causes over the runs in the order given, for example of checkpoints, on the "
        "cases that all have measured. Intervals are of each run alone",
    )
    option(compare, "--csv FILE", "With --over-time: also write the numbers here", type=Path)
    option(compare, "--html FILE", "With --over-time: also write a page with charts here", type=Path)
    option(compare, "--figure FILE", "With --over-time: also draw success by run here, as SVG", type=Path)
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
    from pytest_libero_max.report.comparison.paper_files import write_tables
    from pytest_libero_max.report.formats import counted
    from pytest_libero_max.report.writers.report_files import report_json, write_text

    if options.over_time:
        _compare_over_time(options)
        return
    for name in ("csv", "html", "figure"):
        if getattr(options, name) is not None:
            raise OptionError(f"--{name} is about runs in their order. Give --over-time as well.")
    runs = read_runs(options.folders)
    if options.by_cell:
        _compare_by_cell(options, list(runs.values()))
        return
    if options.published and not options.tables:
        raise OptionError("--published adds rows to tables. Give --tables=FOLDER as well.")
    if options.tables:
        written = write_tables(runs, options.tables, options.restrict, options.published)
        print(f"Written: {written[0]}, and {counted(len(written) - 1, 'file')} beside it")
        if len(runs) < 2:
            return
    comparison = compare_runs(runs, options.restrict)
    if options.json:
        write_text(options.json, report_json(comparison))
    if options.output:
        compared, _ = compared_and_apart(runs, options.restrict)
        write_comparison(comparison, options.output, common_cases(compared, options.restrict))
    say(comparison_lines(comparison, options.flips))


def _compare_over_time(options: argparse.Namespace) -> None:
    from pytest_libero_max.cli.over_time import compare_over_time

    if any((options.by_cell, options.output, options.tables, options.published, options.json)):
        raise OptionError(
            "--over-time was given with an option that it does not take. Beside it, --csv, --html and "
            "--figure can be given."
        )
    compare_over_time(options)


def _compare_by_cell(options: argparse.Namespace, runs: Sequence[RunOutcomes]) -> None:
    from pytest_libero_max.report.comparison.by_cell import document_of, old_less_new
    from pytest_libero_max.report.render.terminal import document_lines
    from pytest_libero_max.report.writers.report_files import write_text

    if len(runs) != 2 or options.output or options.tables or options.published or options.restrict:
        raise OptionError(
            f"--by-cell compares two runs, the old cases first, but {len(runs)} are given, or an option that "
            "it does not take. Beside it, only --json can be given."
        )
    found = old_less_new(*runs)
    if options.json:
        write_text(options.json, json.dumps(found.to_dict(), indent=2) + "\n")
    say(document_lines(document_of(found)))
