"""``libero-max export``: a run in the format of another tool."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option
from pytest_libero_max.report.exports import EXPORTS


def add_command(commands: Commands) -> None:
    """Add ``export`` to the parser."""
    formats = ", ".join(EXPORTS) or "none is installed"
    export = commands.add_parser(
        "export",
        help=f"Write a run in the format of another tool: {formats}",
        description="Packages add formats by entry points (pytest_libero_max.exports).",
    )
    export.add_argument("folder", type=Path, metavar="RUN", help="The output folder of the run")
    export.add_argument(
        "file",
        type=Path,
        metavar="FILE",
        help="Replaced where it exists; a folder where the format has several",
    )
    option(export, "--format NAME", formats, required=True)
    option(
        export,
        "--gate CONDITION",
        "Show the verdict on this gate, in a format that has a place for it; may be repeated "
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
