"""The ``libero-max`` command, for everything around runs. Thin.

``libero-max NAME`` is the module ``NAME``, whose ``add_command`` adds it to the parser.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Any

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.cli.completion import complete
from pytest_libero_max.errors import LiberoMaxError, did_you_mean

GROUPS = {
    "Start here": ("init", "doctor", "check", "show", "compare", "gate", "film"),
    "Before a run": (
        "profiles",
        "events",
        "programs",
        "plan",
        "power",
        "serve",
        "launch",
        "bench",
        "fingerprint",
    ),
    "During and after runs": (
        "runs",
        "view",
        "trend",
        "bisect",
        "audit",
        "monitors",
        "watch",
        "merge",
        "report",
        "export",
        "publish",
        "recovery",
        "rerun",
        "claim",
    ),
    "Training data": ("demos",),
    "Make the benchmark": (
        "catalogue",
        "gallery",
        "eligibility",
        "build",
        "preflight",
        "certify",
        "freeze",
        "verify",
    ),
}
"""Modules with commands by what they are for, in the order of the help."""

_GONE = {"poses": "rerun"}
"""Commands of earlier versions, and those to use instead."""

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
    command = parser()
    complete(command)
    options = command.parse_args(arguments)
    try:
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
    """A parser that suggests a command, and lists commands by group."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            new = _GONE.get(value)
            hint = f"Use libero-max {new}." if new else did_you_mean(value, action.choices)
            raise argparse.ArgumentError(None, f"there is no command {value!r}. {hint}")
        super()._check_value(action, value)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command."""
    command = _Parser(
        prog="libero-max",
        usage="libero-max [-h] [--version] COMMAND ...",
        description="Around runs of pytest --libero-max-policy.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("--version", action="version", version=f"%(prog)s {version('pytest-libero-max')}")
    commands = command.add_subparsers(
        required=True,
        prog=command.prog,
        metavar="COMMAND",
        help=argparse.SUPPRESS,
        parser_class=argparse.ArgumentParser,
    )
    added: dict[str, list[str]] = {}
    for module in (name for names in GROUPS.values() for name in names):
        before = {*commands.choices}
        import_module(f"{__name__}.{module}").add_command(commands)
        added[module] = [name for name in commands.choices if name not in before]
    texts = {str(choice.dest): " ".join((choice.help or "").split()) for choice in commands._choices_actions}
    for name, one in commands.choices.items():
        one.description = f"{texts[name]}. {one.description or ''}".strip()
    command.epilog = "\n".join(_listed(texts, added))
    return command


def _listed(texts: Mapping[str, str], added: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield the commands by group, each with its help."""
    for title, modules in GROUPS.items():
        yield f"{title}:"
        for name in (name for module in modules for name in added[module]):
            yield from textwrap.wrap(
                texts[name], 79, initial_indent=f"  {name:<14}", subsequent_indent=" " * 16
            )
        yield ""
    yield "libero-max COMMAND --help has the options of a command."
