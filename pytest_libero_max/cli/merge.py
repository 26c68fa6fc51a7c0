"""``libero-max merge``: the runs of shards joined into one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``merge`` to the parser."""
    merge = commands.add_parser(
        "merge", help="Join the runs of shards into one; exit status 11 where pairs are missing"
    )
    merge.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="The output folders of the shards"
    )
    merge.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="Folder for the joined run"
    )
    merge.add_argument(
        "--finished",
        action="store_true",
        help="Leave out the folders whose run has not ended or not begun, and say which; may be done again "
        "when more have ended",
    )
    merge.set_defaults(run=_merge)


def _merge(options: argparse.Namespace) -> int:
    from pytest_libero_max.cli.arguments import print_coloured
    from pytest_libero_max.report.exit_status import INCOMPLETE
    from pytest_libero_max.report.writers.report_files import write_reports
    from pytest_libero_max.report.writers.summary import summary_lines
    from pytest_libero_max.runs.merge import finished, merge_folders

    folders, left_out = finished(options.folders) if options.finished else (options.folders, [])
    merge_folders(folders, options.output)
    report, paths = write_reports(options.output)
    print_coloured([*left_out, *summary_lines(report, [str(path) for path in paths])])
    return 0 if report.pairs.complete else INCOMPLETE
