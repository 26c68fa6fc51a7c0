"""Arguments and output that several commands share."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from pytest_libero_max.substrates.registry import DEFAULT, chosen_substrate

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.manifests import Manifest
    from pytest_libero_max.substrates.contract import ChosenSubstrate, SubstrateOptions

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""The place of the parser that a command is added to."""


def option(
    command: argparse.ArgumentParser | argparse._MutuallyExclusiveGroup,
    flag: str,
    help: str,
    *,
    many: bool = False,
    **how: Any,
) -> None:
    """Add an option with a value to a command.

    Args:
        flag: The flag and the name of its value, as the help prints them: ``--jobs N``.
        help: The text of the help; the default is added unless it names one.
        many: True if it may be repeated; its value is then a list.
    """
    name, _, metavar = flag.partition(" ")
    if how.get("default") is not None and "efault" not in help:
        help += " (default: %(default)s)"
    if many:
        how |= {"action": "append", "default": []}
    command.add_argument(name, metavar=metavar or None, help=help, **how)


def switch(command: argparse.ArgumentParser, flag: str, help: str) -> None:
    """Add an option without a value to a command; it is False unless it is given."""
    command.add_argument(flag, action="store_true", help=help)


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """Return the type of an argument that is a whole number of at least ``least`` and at most ``most``."""
    rule = f"of at least {least}" if most is None else f"from {least} to {most}"

    def parse(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = least - 1
        if number < least or (most is not None and number > most):
            raise argparse.ArgumentTypeError(f"{text!r}, but must be a whole number {rule}")
        return number

    return parse


def number(least: float, most: float) -> Callable[[str], float]:
    """Return the type of an argument that is a number from ``least`` to ``most``."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r}, but must be a number from {least:g} to {most:g}")
        return value

    return parse


PORT = whole_number(0, 65_535)
"""Type of an argument that is a port to listen at; 0 is any that is free."""


def add_cadence(command: argparse.ArgumentParser) -> None:
    """Add the options that replace H and Q of a policy."""
    option(command, "--horizon ACTIONS", "Override H (chunk size)", type=whole_number(1))
    option(
        command,
        "--query-interval ACTIONS",
        "Override Q (execution horizon, replan steps)",
        type=whole_number(1),
    )


def add_jobs(command: argparse.ArgumentParser, what: str = "Processes") -> None:
    """Add the option for the number of processes."""
    option(command, "--jobs N", f"{what}", type=whole_number(1), default=2)


def add_libero(command: argparse.ArgumentParser) -> None:
    """Add the options that say where LIBERO is."""
    option(command, "--libero FOLDER", "Checkout of a LIBERO", type=Path, many=True)
    option(command, "--libero-assets FOLDER", "Models and textures, if it has none of its own", type=Path)


def _substrate(text: str) -> ChosenSubstrate:
    try:
        return chosen_substrate(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None


def add_substrate(command: argparse.ArgumentParser) -> None:
    """Add the options of the substrate and of LIBERO's place."""
    option(
        command,
        "--substrate NAME",
        "embedded, libero (libero:variations=own with this package's variations), or one of another package",
        type=_substrate,
        default=DEFAULT,
    )
    add_libero(command)


def substrate_options(options: argparse.Namespace) -> SubstrateOptions:
    """Return the options of a substrate that :func:`add_libero` or :func:`add_substrate` was given."""
    from pytest_libero_max.substrates.contract import SubstrateOptions

    chosen = options.substrate.options if hasattr(options, "substrate") else SubstrateOptions()
    return replace(
        chosen,
        installations=tuple(options.libero),
        assets=options.libero_assets,
        classification=getattr(options, "plus_classification", None),
    )


def manifest_of(name: str) -> Manifest:
    """Return a track by its name or a manifest by its path, with its events and changes checked."""
    from pytest_libero_max.benchmark.tracks import load_cases
    from pytest_libero_max.events.registry import check_cases

    manifest = load_cases(name)
    check_cases(manifest)
    return manifest
