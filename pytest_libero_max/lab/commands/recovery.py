"""``libero-max lab recovery``: runs of one policy with and without restoration of its images."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option, switch
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``recovery`` to the parser."""
    recovery = commands.add_parser(
        "recovery", help="Compare runs of one policy with and without restoration of its images"
    )
    recovery.add_argument(
        "folders",
        type=Path,
        nargs="+",
        metavar="FOLDER",
        help="The output folders of runs without a wrapper, and with --libero-max-wrap=restore:MODE",
    )
    switch(recovery, "--restrict", "Compare on common cases where the runs have different ones")
    option(recovery, "--json FILE", "Also write the numbers here", type=Path)
    recovery.set_defaults(run=_recovery)


def _recovery(options: argparse.Namespace) -> None:
    from pytest_libero_max.lab.recovery import compare_recovery, document_of
    from pytest_libero_max.report.render.terminal import document_lines
    from pytest_libero_max.report.writers.report_files import report_json, write_text
    from pytest_libero_max.runs.store import read_pairs

    recovery = compare_recovery([read_pairs(folder) for folder in options.folders], options.restrict)
    if options.json:
        write_text(options.json, report_json(recovery))
    say(document_lines(document_of(recovery)))
