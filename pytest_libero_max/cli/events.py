"""``libero-max list events``: the kinds of events, with those of installed packages."""

from __future__ import annotations

import argparse
import inspect
import textwrap
from collections.abc import Iterator

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``events`` to the parser."""
    events = commands.add_parser("events", help="List the kinds of events, with those of installed packages")
    events.set_defaults(run=_events)


def _events(options: argparse.Namespace) -> int:
    from pytest_libero_max.events.registry import EVENTS

    say(line for name in EVENTS for line in _lines(name))
    return 0


def _lines(name: str) -> Iterator[str]:
    """Yield name, family and severities of a kind, what happens, and what a policy is expected to do."""
    from pytest_libero_max.events.registry import EVENTS

    kind = EVENTS[name]
    yield f"{name}: {kind.family}, severity {' and '.join(dict.fromkeys(kind.severities))}"
    for text in (inspect.getdoc(type(kind)) or "", f"Expected: {kind.expected}"):
        yield from textwrap.wrap(text.split("\n\n")[0], 100, initial_indent="  ", subsequent_indent="  ")
