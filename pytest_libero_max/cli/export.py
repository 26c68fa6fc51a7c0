"""``libero-max export``: a run in the format of another tool."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option


def add_command(commands: Commands) -> None:
    """Add ``export`` to the parser."""
    export = commands.add_parser(
        "export",
        help="Write a run in the format of another tool: ctrf, every-eval-ever or robostats",
        description="ctrf: JSON, a test for each planned pair and each gate; a measured pair passes, as in "
        "pytest. every-eval-ever: a folder with two files, rates by arm and JSON Lines of instances, as its "
        "validator takes them. robostats: JSON Lines as its recorder writes. The last two have a line for "
        "each arm of each measured pair.",
    )
    export.add_argument("folder", type=Path, metavar="RUN", help="The output folder of the run")
    export.add_argument(
        "file", type=Path, metavar="FILE", help="Replaced where it exists; a folder for every-eval-ever"
    )
    option(export, "--format NAME", "ctrf, every-eval-ever or robostats", required=True)
    option(
        export,
        "--gate CONDITION",
        "Show the verdict on this gate in ctrf, which alone has a place for it; may be repeated "
        "(default: libero_max_gate of the ini file)",
        many=True,
    )
    export.set_defaults(run=_export)


def _export(options: argparse.Namespace) -> None:
    from pytest_libero_max.cli.ini_file import gates_of
    from pytest_libero_max.report.exports import export_files
    from pytest_libero_max.report.gate_results import decide_on
    from pytest_libero_max.report.writers.report_files import make_folder, report_of, write_text
    from pytest_libero_max.runs.store import read_pairs

    stored = read_pairs(options.folder)
    gates, start = gates_of(options.gate, Path.cwd())
    verdicts = decide_on(gates, stored, report_of(stored), start) if gates else ()
    files = export_files(options.format, stored, verdicts)
    for name, text in files.items():
        path = options.file / name
        if name:
            make_folder(path.parent)
        write_text(path, text)
    print(f"Written: {', '.join(str(options.file / name) for name in files)}")
