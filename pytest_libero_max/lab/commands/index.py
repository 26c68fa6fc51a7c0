"""``libero-max publish index``: published runs as one page."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option
from pytest_libero_max.errors import counted


def add_command(commands: Commands) -> None:
    """Add ``index`` to the parser."""
    index = commands.add_parser(
        "index",
        help="Write a page of published runs, with a table to be sorted for each set of cases",
        description="Reports, figures and cases of each run are computed again first. A run that does not "
        "agree with itself is named at the top of the page and in no table, and the exit status is 1. The "
        "page is one static file.",
    )
    index.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="A published run, or a folder above several"
    )
    option(index, "--output FILE", "The page", type=Path, default=Path("index.html"))
    option(
        index,
        "--verified FILE",
        "Checks of those who run the index, written by libero-max publish verify --record",
        type=Path,
    )
    index.set_defaults(run=_index)


def _index(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.index.index_page import index_html
    from pytest_libero_max.lab.index.run_index import published_in, run_index
    from pytest_libero_max.report.publication import read_checks
    from pytest_libero_max.report.writers.report_files import write_text

    known = {} if options.verified is None else read_checks(options.verified)
    index = run_index(published_in(options.folders), known)
    write_text(options.output, index_html(index, options.output.parent))
    for folder, reason in index.refused:
        print(f"refused: {folder}: {reason}")
    print(f"Written: {options.output}, {counted(sum(map(len, index.groups.values())), 'run')}")
    return 1 if index.refused else 0
