"""Arguments and output that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pytest_libero_max.cli.work import Work
from pytest_libero_max.substrates.registry import DEFAULT

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.manifests import Manifest
    from pytest_libero_max.construction.examiner import Progress
    from pytest_libero_max.substrates.contract import Catalogue, SubstrateOptions


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


PORT = whole_number(0, 65_535)
"""Type of an argument that is a port to listen at; 0 is any that is free."""


def add_libero(command: argparse.ArgumentParser) -> None:
    """Add the options that say where LIBERO is."""
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
    """Add the options of the substrate and of LIBERO's place."""
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
    """Return the options of a substrate that :func:`add_libero` or :func:`add_substrate` was given."""
    from pytest_libero_max.substrates.contract import SubstrateOptions

    variations: Literal["installed", "own"] = getattr(options, "source_variations", "installed")
    return SubstrateOptions(
        tuple(options.libero),
        options.libero_assets,
        variations=variations,
        classification=getattr(options, "plus_classification", None),
    )


def add_classification(command: argparse.ArgumentParser) -> None:
    """Add the option for the classification of LIBERO-Plus."""
    command.add_argument(
        "--plus-classification",
        type=Path,
        metavar="FILE",
        help="On the libero substrate: task_classification.json of LIBERO-Plus's repository, which its "
        "package lacks (default: that of the checkout)",
    )


def add_expert(command: argparse.ArgumentParser, *, default: str | None) -> None:
    """Add the option for the policy that plays the cases that pass."""
    command.add_argument(
        "--expert",
        metavar="POLICY",
        default=default,
        help="Privileged policy that solves the tasks, as for pytest --libero-max-policy: it plays each case "
        "that passes, and one that it completes is certified. It decides nothing else (default: "
        + (default or "none; then nothing is certified")
        + ")",
    )


def add_examination(command: argparse.ArgumentParser) -> None:
    """Add the options for the number of processes that examine cases, and for the folder of their results."""
    command.add_argument("--jobs", type=int, default=2, metavar="N", help="Processes (default: %(default)s)")
    command.add_argument(
        "--work",
        type=Path,
        default=Path(".libero-max"),
        metavar="FOLDER",
        help="Keeps examinations between interruptions (default: %(default)s)",
    )


def tell(work: Work) -> Callable[[Progress], None]:
    """Return a function that shows the progress of an examiner."""
    return lambda progress: work.show(str(progress), last=progress.ended)


def catalogue_of(options: argparse.Namespace) -> Catalogue:
    """Return the catalogue of source variations of the substrate that is asked for."""
    from pytest_libero_max.substrates.registry import SUBSTRATES

    return SUBSTRATES[options.substrate].catalogue(substrate_options(options))


def manifest_of(name: str) -> Manifest:
    """Return a track by its name or a manifest by its path, with its events and changes checked."""
    from pytest_libero_max.benchmark.tracks import load_cases
    from pytest_libero_max.events.registry import check_cases

    manifest = load_cases(name)
    check_cases(manifest)
    return manifest
