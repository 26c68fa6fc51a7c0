"""``libero-max compare --tables FOLDER``: the tables and figures that the paper prints, for any runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import option, switch

OPTIONS = ("published",)
TAKES = ("restrict", "json", "output")


def add_options(compare: argparse.ArgumentParser) -> None:
    """Add ``--tables`` and ``--published``."""
    option(
        compare,
        "--tables FOLDER",
        "Also write the tables and figures that the paper prints here, for these runs or for one: "
        "Markdown, CSV and LaTeX",
        type=Path,
    )
    switch(compare, "--published", "Add the published results to the tables; without a run, write them alone")


def compare(options: argparse.Namespace) -> bool:
    """Write the tables; True for several runs, whose comparison follows."""
    from pytest_libero_max.lab.comparisons.paper_files import write_tables
    from pytest_libero_max.report.comparison.compare import read_runs
    from pytest_libero_max.report.formats import counted

    runs = read_runs(options.folders)
    written = write_tables(runs, options.tables, options.restrict, options.published)
    print(f"Written: {written[0]}, and {counted(len(written) - 1, 'file')} beside it")
    return len(runs) > 1
