"""The options of commands that need a substrate other than the embedded one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pytest_libero_max.substrates.registry import DEFAULT

if TYPE_CHECKING:
    from pytest_libero_max.substrates.contract import SubstrateOptions


def add_libero(command: argparse.ArgumentParser) -> None:
    """Let a command be told where LIBERO is."""
    command.add_argument(
        "--libero", type=Path, action="append", default=[], metavar="FOLDER", help="Checkout of a LIBERO"
    )
    command.add_argument(
        "--libero-assets",
        type=Path,
        metavar="FOLDER",
        help="Models and textures, if it has none of its own",
    )


def add_substrate(command: argparse.ArgumentParser) -> None:
    """Let a command be told what builds its worlds, and where LIBERO is."""
    command.add_argument(
        "--substrate",
        default=DEFAULT,
        metavar="NAME",
        help="embedded, libero, or one of another package (default: %(default)s)",
    )
    command.add_argument(
        "--source-variations",
        default="installed",
        choices=("installed", "own"),
        help="On libero: variations of LIBERO-Plus and -PRO as installed, or own (default: %(default)s)",
    )
    add_libero(command)


def substrate_options(options: argparse.Namespace) -> SubstrateOptions:
    """What :func:`add_libero` or :func:`add_substrate` was told."""
    from pytest_libero_max.substrates.contract import SubstrateOptions

    variations: Literal["installed", "own"] = getattr(options, "source_variations", "installed")
    return SubstrateOptions(
        tuple(options.libero),
        options.libero_assets,
        variations=variations,
        classification=getattr(options, "plus_classification", None),
    )
