"""``libero-max dev build``: every track from nothing, or a fresh draw beside them."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, add_substrate, option, substrate_options, switch
from pytest_libero_max.errors import OptionError
from pytest_libero_max.makers.arguments import add_classification, add_examination, catalogue_of, examining

if TYPE_CHECKING:
    from pytest_libero_max.makers.construction.release import ExamineCases, Release


def add_command(commands: Commands) -> None:
    """Add ``build`` to the parser."""
    build = commands.add_parser(
        "build",
        help="Build every track from nothing, or a fresh draw: select, preflight, replace, freeze",
        description="No policy has a part in it. Interrupted, it goes on where it stopped. With --draw it "
        "makes new cases from the population of a frozen track: first with --commit, which keeps a seed and "
        "writes the digest to publish; later without, which makes the cases and reveals the seed.",
    )
    build.add_argument("folder", type=Path, metavar="FOLDER", help="Folder for the tracks")
    build.add_argument(
        "tracks",
        nargs="*",
        metavar="TRACK",
        help="On the libero substrate: smoke, max with what is drawn from it, or both (default: both); on "
        "a substrate with tracks of unmodified tasks: some of them (default: all); with --draw: the track "
        "that gets new cases (default: lite)",
    )
    option(
        build,
        "--paper-lite FILE",
        "Only write the authors' own Lite beside the genuine tracks of FOLDER, from the ids in the first "
        "column of their case_index.csv",
        type=Path,
    )
    option(
        build,
        "--draw NAME",
        "Make a fresh draw, for example 2026Q4, in FOLDER, which lies beside the frozen tracks",
    )
    switch(build, "--commit", "With --draw: only draw its seed, and write the digest to publish")
    option(
        build,
        "--seed-file FILE",
        "With --draw: the seed, secret until the cases are made (default: NAME.seed in --work's folder)",
        type=Path,
    )
    add_classification(build)
    add_substrate(build)
    add_examination(build)
    build.set_defaults(run=_build)


def _build(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.fresh_draw import COMMITMENT, SEED, bind
    from pytest_libero_max.makers.construction.overview import overview_lines, write_overview
    from pytest_libero_max.makers.construction.release import write_release
    from pytest_libero_max.makers.construction.verification import verify

    folder, name = options.folder, options.draw
    if options.paper_lite is not None:
        _write_paper_lite(options)
        write_overview(folder)
        print("\n".join(verify(folder)))
        return
    if name is None and (options.commit or options.seed_file):
        raise OptionError("--commit and --seed-file are about a fresh draw. Add --draw NAME.")
    seed_file: Path = options.seed_file or options.work / f"{name}.seed"
    if name is not None and folder.resolve().name != name:
        raise OptionError(f"{folder} is the folder of the draw {name}, and must be called {name!r}.")
    if options.commit:
        print(f"{bind(folder, name, seed_file)}\nPublish {folder / COMMITMENT}, and keep {seed_file} secret.")
        return
    build, checked = _tracks(options) if name is None else (_draw(options, seed_file), True)
    with examining(options) as (work, examiner):
        work.say(f"Results are kept in {examiner.path()}")
        write_release(build(examiner.examine), folder)
    if name is not None:
        (folder / SEED).write_bytes(seed_file.read_bytes())
    write_overview(folder)
    print("\n".join([*overview_lines(folder), *(["", *verify(folder)] if checked else ())]))


def _tracks(options: argparse.Namespace) -> tuple[Callable[[ExamineCases], Release], bool]:
    """Return what builds the tracks of a substrate, and whether they are checked as frozen ones."""
    from pytest_libero_max.makers.construction.genuine_tracks import TRACKS, build_genuine
    from pytest_libero_max.makers.construction.release import build_release
    from pytest_libero_max.makers.construction.unmodified_tracks import Population, build_unmodified
    from pytest_libero_max.substrates.registry import SUBSTRATES

    kind, settings = SUBSTRATES[options.substrate.name], substrate_options(options)
    if kind.tracks(settings).per_event:
        population = Population(kind, settings)
        names = options.tracks or population.per_event
        return partial(build_unmodified, population=population, names=names), True
    if not kind.plays_frozen:
        names = options.tracks or TRACKS
        return partial(build_genuine, catalogue=catalogue_of(options), names=names), False
    if options.tracks or options.plus_classification:
        raise OptionError(
            f"The {options.substrate.name} tracks are built together, from the package's own catalogues. "
            "Give no TRACK and no --plus-classification, or add --substrate libero."
        )
    return build_release, True


def _draw(options: argparse.Namespace, seed_file: Path) -> Callable[[ExamineCases], Release]:
    from pytest_libero_max.makers.construction.fresh_draw import build_draw, frozen_beside, read_draw
    from pytest_libero_max.substrates.registry import SUBSTRATES

    if not SUBSTRATES[options.substrate.name].plays_frozen:
        raise OptionError(
            f"A fresh draw is made on embedded scenes, and --substrate {options.substrate.name} has others. "
            "Leave --substrate out."
        )
    if len(options.tracks) > 1:
        raise OptionError.seen("TRACK", " ".join(options.tracks), ", but a draw is of one track.")
    (track,) = options.tracks or ("lite",)
    frozen = frozen_beside(options.folder, track, options.draw)
    return partial(build_draw, track=track, frozen=frozen, draw=read_draw(options.folder, seed_file))


def _write_paper_lite(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.tracks import PAPER_LITE
    from pytest_libero_max.makers.construction.paper_lite import paper_lite
    from pytest_libero_max.makers.construction.release import add_track
    from pytest_libero_max.substrates.registry import SUBSTRATES

    if options.draw is not None or options.tracks or SUBSTRATES[options.substrate.name].plays_frozen:
        raise OptionError(
            "--paper-lite makes one track of the genuine scenes. Give no TRACK and no --draw, and add "
            "--substrate libero."
        )
    lines = options.paper_lite.read_text(encoding="utf-8-sig").splitlines()[1:]
    manifest = paper_lite([line.partition(",")[0] for line in lines], catalogue_of(options))
    add_track(options.folder, PAPER_LITE, manifest)
