"""Completion of ``libero-max`` in the shell, by argcomplete, which is the extra ``completion``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from typing import Any

from pytest_libero_max.cli.commands import CommandPlace


def complete(command: argparse.ArgumentParser) -> None:
    """Answer the shell and end the process, if it is the shell that asks."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    import argcomplete

    _add_all(command)
    argcomplete.autocomplete(command, default_completer=_values)


def _add_all(command: argparse.ArgumentParser) -> None:
    """Add every command to a parser and to the groups in it."""
    for place in (action for action in command._actions if isinstance(action, CommandPlace)):
        place.require_all()
        for inner in place.choices.values():
            _add_all(inner)


def _values(action: argparse.Action, **asked: Any) -> Iterable[str]:
    """Return the names that an argument may have; files and folders for all others."""
    from argcomplete.completers import FilesCompleter

    from pytest_libero_max.benchmark.tracks import all_track_names
    from pytest_libero_max.policies.profile import profile_names

    metavar = str(action.metavar or "")
    files = FilesCompleter()(action=action, **asked)
    if action.dest == "profile" or metavar == "NAME|PATH":
        return [*profile_names(), *files]
    return [*all_track_names(), *files] if metavar.startswith("TRACK") or action.dest == "track" else files
