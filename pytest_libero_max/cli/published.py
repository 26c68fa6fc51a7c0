"""``libero-max list published``: the results of the paper."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands


def add_command(commands: Commands) -> None:
    """Add ``published`` to the parser."""
    published = commands.add_parser("published", help="Results published in the paper")
    published.set_defaults(run=_published)


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))
