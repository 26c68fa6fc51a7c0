"""``libero-max compare --by-cell``: success of one policy on old cases less that on new ones."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from pytest_libero_max.cli.arguments import switch
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

OPTIONS = ()
TAKES = ("json",)


def add_options(compare: argparse.ArgumentParser) -> None:
    """Add ``--by-cell``."""
    switch(
        compare,
        "--by-cell",
        "Of two runs of one policy on different cases, the old ones first: success on the old less that "
        "on the new ones within cells (source, event, variant), which tells over-fitting from ability",
    )


def compare(options: argparse.Namespace) -> bool:
    """Print success on old cases less that on new ones."""
    from pytest_libero_max.lab.comparisons.old_less_new import document_of, old_less_new
    from pytest_libero_max.report.comparison.compare import read_runs
    from pytest_libero_max.report.render.terminal import document_lines
    from pytest_libero_max.report.writers.report_files import write_text

    runs = read_runs(options.folders)
    if len(runs) != 2:
        raise OptionError.seen("runs", len(runs), ", but --by-cell compares two runs, the old cases first.")
    result = old_less_new(*runs.values())
    if options.json:
        write_text(options.json, json.dumps(asdict(result), indent=2) + "\n")
    say(document_lines(document_of(result)))
    return False
