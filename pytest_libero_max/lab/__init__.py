"""What goes beyond the paper, attached through the entry points that any package can use.

``pyproject.toml`` declares its commands, formats and policies. Nothing outside this folder imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_libero_max.cli.commands import CommandPlace


def add_command(commands: CommandPlace) -> None:
    """Add ``lab`` to the parser."""
    commands.add_group("lab", "What goes beyond the paper")
