"""``libero-max dev catalogue``: number of source variations of the embedded scenes."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands


def add_command(commands: Commands) -> None:
    """Add ``catalogue`` to the parser."""
    catalogue = commands.add_parser("catalogue", help="Count the source variations of the embedded scenes")
    catalogue.set_defaults(run=_catalogue)


def _catalogue(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.configurations import count_lines

    print("\n".join(count_lines()))
