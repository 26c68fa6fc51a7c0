"""``libero-max dev freeze``: the smaller tracks, drawn again from max."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands


def add_command(commands: Commands) -> None:
    """Add ``freeze`` to the parser."""
    freeze = commands.add_parser("freeze", help="Draw the smaller tracks again from max, with checksums")
    freeze.add_argument("folder", type=Path, metavar="FOLDER", help="The tracks, as build wrote them")
    freeze.set_defaults(run=_freeze)


def _freeze(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.overview import write_overview
    from pytest_libero_max.makers.construction.release import write_splits
    from pytest_libero_max.makers.construction.verification import verify

    write_splits(options.folder)
    write_overview(options.folder)
    print("\n".join(verify(options.folder)))
