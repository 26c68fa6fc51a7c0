"""The ``libero-max`` command, for everything around runs. Thin.

``libero-max NAME`` is the module ``NAME``, whose ``add_command`` adds it to the parser, or a module of
another package (:mod:`.commands`).
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import Any

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.cli.commands import GROUPS, CommandPlace, add_place
from pytest_libero_max.cli.completion import complete
from pytest_libero_max.errors import LiberoMaxError

PIPE_CLOSED = 141
"""Exit status where the reader of standard output has gone: that of a process ended by SIGPIPE."""

INTERRUPTED = 130
"""Exit status after Ctrl-C: that of a process ended by SIGINT."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        The exit status: that of the command, 0 for most; 1 with a message on standard error;
        :data:`PIPE_CLOSED`, without any, for ``libero-max list cases max | head``; :data:`INTERRUPTED`.
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
    options = argparse.Namespace()
    try:
        command = parser()
        complete(command)
        options = command.parse_args(arguments)
        return int(options.run(options) or 0)
    except LiberoMaxError as error:
        said = _named_as_here(f"libero-max: {error}", options)
        print("\n".join(map(printable, said.splitlines())), file=sys.stderr)
        return 1
    except OSError as error:
        if error.filename is None:  # no file that was named, for example a pipe whose reader has gone
            raise
        print(
            f"libero-max: {str(error.filename)!r} cannot be read or written: {error.strerror}. Give another "
            "path, or make its folder.",
            file=sys.stderr,
        )
        return 1
    except KeyboardInterrupt:
        work = getattr(options, "work", None)
        kept = f" What was examined is kept in {work}: give the same command again to go on." if work else ""
        print(f"libero-max: interrupted.{kept}", file=sys.stderr)
        return INTERRUPTED


def _named_as_here(text: str, options: argparse.Namespace) -> str:
    """Return a message about an option of pytest with the name that it has for this command."""
    for name in vars(options):
        flag = name.replace("_", "-")
        text = re.sub(rf"(?<!pytest )--libero-max-{flag}\b(?!-)", f"--{flag}", text)
    return text


class _Parser(argparse.ArgumentParser):
    """A parser that adds commands when they are given or listed, suggests them, and lists them by group."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, CommandPlace):
            action.require(value)
            if value not in action.choices:
                raise argparse.ArgumentError(None, f"there is no command {value!r}. {action.hint(value)}")
        super()._check_value(action, value)

    def format_help(self) -> str:
        for place in (action for action in self._actions if isinstance(action, CommandPlace)):
            place.require_all()
            self.epilog = "\n".join(_listed(self.prog, place))
        return super().format_help()


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command."""
    command = _Parser(
        prog="libero-max",
        usage="libero-max [-h] [--version] COMMAND ...",
        description="Around runs of pytest --libero-max-policy.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("--version", action="version", version=f"%(prog)s {version('pytest-libero-max')}")
    add_place(command)
    return command


def _listed(prog: str, place: CommandPlace) -> Iterator[str]:
    """Yield commands, by group where there are groups, each with its help."""
    groups: dict[str, tuple[str, ...]] = {} if place.prefix else {**GROUPS}
    inside = {name for names in groups.values() for name in names}
    more = tuple(name for name in place.choices if name not in inside)
    groups |= {"More" if groups else "Commands": more} if more else {}
    for title, names in groups.items():
        yield f"{title}:"
        for name, text in place.listed(names):
            yield from textwrap.wrap(text, 79, initial_indent=f"  {name:<14}", subsequent_indent=" " * 16)
        yield ""
    yield f"{prog} COMMAND --help has the options of a command."
