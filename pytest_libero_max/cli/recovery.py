"""``libero-max recovery``: runs of one policy with and without restoration of its images."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


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
        help="The output folders of runs with --libero-max-restore=native, always and gated, in any order",
    )
    recovery.add_argument(
        "--restrict", action="store_true", help="Compare on common cases where the runs have different ones"
    )
    recovery.add_argument("--json", type=Path, metavar="FILE", help="Also write the numbers here")
    recovery.set_defaults(run=_recovery)


def _recovery(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.studies.recovery import recovery_of
    from pytest_libero_max.report.studies.recovery_text import recovery_lines
    from pytest_libero_max.report.writers.report_files import report_json, write_text

    recovery = recovery_of(options.folders, options.restrict)
    if options.json:
        write_text(options.json, report_json(recovery))
    say(recovery_lines(recovery))
