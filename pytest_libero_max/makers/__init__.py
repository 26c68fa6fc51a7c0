"""Making of the tracks, and measuring of the package's speed. Nothing that plays imports it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_libero_max.cli.commands import CommandPlace


def add_command(commands: CommandPlace) -> None:
    """Add ``dev`` to the parser."""
    commands.add_group("dev", "What made the tracks and measures our speed")
