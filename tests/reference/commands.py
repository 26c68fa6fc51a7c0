"""The page of the ``libero-max`` command."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from pytest_libero_max import cli
from pytest_libero_max.cli.commands import CommandPlace
from tests.reference.markdown import code

_COMPLETION = """\
The shell completes commands, options, profiles, tracks and paths with the extra `completion`. In the
environment in which the plugin is installed:

```sh
pip install -e '.[completion]'                       # in the clone
eval "$(register-python-argcomplete libero-max)"   # Bash and Zsh; a line for ~/.bashrc or ~/.zshrc
```"""


def page() -> str:
    """The text."""
    commands = "\n\n".join(_command(name, parser, help) for name, parser, help in _commands(cli.parser()))
    parts = ("# The `libero-max` command", "For what is done before and after runs.", _COMPLETION, commands)
    return "\n\n".join(parts) + "\n"


def _commands(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser, str]]:
    """Every command, and after it the commands that it has itself."""
    for action in parser._actions:
        if isinstance(action, CommandPlace):
            action.require_all()
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, command in action.choices.items():
                yield name, command, helps[name]
                for part, its_parser, its_help in _commands(command):
                    yield f"{name} {part}", its_parser, its_help


def _command(name: str, parser: argparse.ArgumentParser, help: str) -> str:
    rows = [
        f"- {code(_spelling(action))}: {' '.join(_help(action).split())}"
        for action in parser._actions
        if action.dest != "help"
        and action.help is not argparse.SUPPRESS
        and not isinstance(action, argparse._SubParsersAction)
    ]
    usage = "\n".join(rows)
    own = " ".join((parser.description or "").split())
    text = own if own.startswith(" ".join(help.split())) else f"{help}. {own}".strip()
    level = "###" if " " in name else "##"
    return f"{level} `libero-max {name}`\n\n{text}\n\n{usage}".strip()


def _spelling(action: argparse.Action) -> str:
    metavar = action.metavar
    if metavar is None and action.choices is not None:
        metavar = "{" + ",".join(map(str, action.choices)) + "}"
    value = "" if metavar is None else str(metavar)
    if not action.option_strings:
        return f"[{value or action.dest}]" if action.nargs == "?" else value or action.dest
    words = f"{action.option_strings[-1]} {value}".strip()
    return f"{words} ..." if action.nargs == "+" else words


def _help(action: argparse.Action) -> str:
    return (action.help or "").replace("%(default)s", str(action.default)).replace("%%", "%")
