"""``libero-max build``: every track from nothing."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import (
    add_classification,
    add_examination,
    add_substrate,
    catalogue_of,
    substrate_options,
    tell,
)
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``build`` to the parser."""
    build = commands.add_parser(
        "build",
        help="Build every track from nothing: select, preflight, replace, freeze",
        description="No policy has a part in it. Interrupted, it goes on where it stopped.",
    )
    build.add_argument("folder", type=Path, metavar="FOLDER", help="Folder for the tracks")
    build.add_argument(
        "tracks",
        nargs="*",
        metavar="TRACK",
        help="On the libero substrate: smoke, max with what is drawn from it, or both (default: both)",
    )
    add_classification(build)
    add_substrate(build)
    add_examination(build)
    build.set_defaults(run=_build)


def _build(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.examiner import Examiner
    from pytest_libero_max.construction.genuine_tracks import TRACKS, build_genuine
    from pytest_libero_max.construction.overview import overview_lines, write_overview
    from pytest_libero_max.construction.release import build_release, write_release
    from pytest_libero_max.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    told, whole = substrate_options(options), SUBSTRATES[options.substrate].plays_frozen
    if whole and (options.tracks or options.plus_classification):
        raise OptionError(
            f"The {options.substrate} tracks are built together, from the package's own catalogues. Give no "
            "TRACK and no --plus-classification, or add --substrate libero."
        )
    catalogue = catalogue_of(options)
    with (
        Work() as work,
        Examiner(options.work, options.jobs, tell(work), options.substrate, told) as examiner,
    ):
        work.say(f"Results are kept in {examiner.path()}")
        if whole:
            release = build_release(examiner.examine)
        else:
            release = build_genuine(examiner.examine, catalogue, options.tracks or TRACKS)
        write_release(release, options.folder)
    write_overview(options.folder)
    checks = ["", *verify(options.folder)] if whole else []
    print("\n".join([*overview_lines(options.folder), *checks]))
