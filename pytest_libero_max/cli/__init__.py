"""The ``libero-max`` command, for everything around runs. Thin.

``libero-max NAME`` is the module ``NAME``, whose ``add_command`` adds it to the parser.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.errors import LiberoMaxError

COMMANDS = (
    "check",
    "serve",
    "bench",
    "doctor",
    "plan",
    "launch",
    "watch",
    "report",
    "compare",
    "recovery",
    "publish",
    "merge",
    "gate",
    "power",
    "film",
    "rerun",
    "demos",
    "catalogue",
    "gallery",
    "eligibility",
    "build",
    "certify",
    "preflight",
    "freeze",
    "verify",
    "show",
)
"""Modules with commands, in the order of the help."""

PIPE_CLOSED = 141
"""Exit status where the reader of standard output has gone: that of a process ended by SIGPIPE."""

INTERRUPTED = 130
"""Exit status after Ctrl-C: that of a process ended by SIGINT."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Words after ``libero-max``; those of the process by default.

    Returns:
        The exit status: that of the command, 0 for most; 1 with a message on standard error;
        :data:`PIPE_CLOSED`, without any, for ``libero-max show max | head``; :data:`INTERRUPTED`.
    """
    try:
        try:
            return _run(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # What is still buffered would be written, and complained about, when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED


def _run(arguments: Sequence[str] | None) -> int:
    options = parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except LiberoMaxError as error:
        print("\n".join(map(printable, f"libero-max: {error}".splitlines())), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        work = getattr(options, "work", None)
        kept = f" What was examined is kept in {work}: give the same command again to go on." if work else ""
        print(f"libero-max: interrupted.{kept}", file=sys.stderr)
        return INTERRUPTED


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command."""
    command = argparse.ArgumentParser(
        prog="libero-max",
        description="Around runs of pytest --libero-max-policy: measure, compare, build the benchmark.",
    )
    commands = command.add_subparsers(required=True, metavar="COMMAND")
    for name in COMMANDS:
        import_module(f"{__name__}.{name}").add_command(commands)
    return command
