"""The ``libero-max`` command: what is done around runs, not in them. Thin.

One module a subject; each adds its commands to the parser.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from pytest_libero_max.cli import building, measuring, results
from pytest_libero_max.errors import LiberoMaxError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Words after ``libero-max``; those of the process by default.

    Returns:
        The exit status: 0, or 1 with a message on standard error.
    """
    options = parser().parse_args(arguments)
    try:
        options.run(options)
    except LiberoMaxError as error:
        print(f"libero-max: {error}", file=sys.stderr)
        return 1
    return 0


def parser() -> argparse.ArgumentParser:
    """The parser of the whole command."""
    command = argparse.ArgumentParser(
        prog="libero-max",
        description="Around runs of pytest --libero-max-policy: measure, compare, build the benchmark.",
    )
    commands = command.add_subparsers(required=True, metavar="COMMAND")
    for subject in (measuring, results, building):
        subject.add_commands(commands)
    return command
