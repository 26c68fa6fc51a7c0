"""``libero-max dev build``: every track from nothing, or a fresh draw beside them."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, add_substrate, option, substrate_options, switch
from pytest_libero_max.errors import OptionError
from pytest_libero_max.makers.arguments import add_classification, add_examination, catalogue_of, examining


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
    if options.paper_lite is not None:
        _build_paper_lite(options)
        return
    if options.draw is not None:
        _build_draw(options)
        return
    if options.commit or options.seed_file:
        raise OptionError("--commit and --seed-file are about a fresh draw. Add --draw NAME.")
    from pytest_libero_max.makers.construction.genuine_tracks import TRACKS, build_genuine
    from pytest_libero_max.makers.construction.overview import overview_lines, write_overview
    from pytest_libero_max.makers.construction.release import build_release, write_release
    from pytest_libero_max.makers.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    if SUBSTRATES[options.substrate.name].tracks(substrate_options(options)).per_event:
        _build_unmodified(options)
        return
    whole = SUBSTRATES[options.substrate.name].plays_frozen
    if whole and (options.tracks or options.plus_classification):
        raise OptionError(
            f"The {options.substrate.name} tracks are built together, from the package's own catalogues. "
            "Give no TRACK and no --plus-classification, or add --substrate libero."
        )
    catalogue = catalogue_of(options)
    with examining(options) as (work, examiner):
        work.say(f"Results are kept in {examiner.path()}")
        if whole:
            release = build_release(examiner.examine)
        else:
            release = build_genuine(examiner.examine, catalogue, options.tracks or TRACKS)
        write_release(release, options.folder)
    write_overview(options.folder)
    checks = ["", *verify(options.folder)] if whole else []
    print("\n".join([*overview_lines(options.folder), *checks]))


def _build_unmodified(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.overview import overview_lines, write_overview
    from pytest_libero_max.makers.construction.release import write_release
    from pytest_libero_max.makers.construction.unmodified_tracks import Population, build_unmodified
    from pytest_libero_max.makers.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    population = Population(SUBSTRATES[options.substrate.name], substrate_options(options))
    with examining(options) as (work, examiner):
        work.say(f"Results are kept in {examiner.path()}")
        release = build_unmodified(examiner.examine, population, options.tracks or population.per_event)
        write_release(release, options.folder)
    write_overview(options.folder)
    print("\n".join([*overview_lines(options.folder), "", *verify(options.folder)]))


def _build_paper_lite(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.tracks import PAPER_LITE
    from pytest_libero_max.makers.construction.overview import write_overview
    from pytest_libero_max.makers.construction.paper_lite import paper_lite
    from pytest_libero_max.makers.construction.release import add_track
    from pytest_libero_max.makers.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    whole = SUBSTRATES[options.substrate.name].plays_frozen
    if options.draw is not None or options.tracks or whole:
        raise OptionError(
            "--paper-lite makes one track of the genuine scenes. Give no TRACK and no --draw, and add "
            "--substrate libero."
        )
    lines = options.paper_lite.read_text(encoding="utf-8-sig").splitlines()[1:]
    manifest = paper_lite([line.partition(",")[0] for line in lines], catalogue_of(options))
    add_track(options.folder, PAPER_LITE, manifest)
    write_overview(options.folder)
    print("\n".join(verify(options.folder)))


def _build_draw(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.fresh_draw import (
        COMMITMENT,
        SEED,
        bind,
        build_draw,
        frozen_beside,
        read_draw,
    )
    from pytest_libero_max.makers.construction.overview import overview_lines, write_overview
    from pytest_libero_max.makers.construction.release import write_release
    from pytest_libero_max.makers.construction.verification import verify
    from pytest_libero_max.substrates.registry import SUBSTRATES

    folder, name = options.folder, options.draw
    seed_file = options.seed_file or options.work / f"{name}.seed"
    if folder.resolve().name != name:
        raise OptionError(f"{folder} is the folder of the draw {name}, and must be called {name!r}.")
    if options.commit:
        print(f"{bind(folder, name, seed_file)}\nPublish {folder / COMMITMENT}, and keep {seed_file} secret.")
        return
    if not SUBSTRATES[options.substrate.name].plays_frozen:
        raise OptionError(
            f"A fresh draw is made on embedded scenes, and --substrate {options.substrate.name} has others. "
            "Leave --substrate out."
        )
    if len(options.tracks) > 1:
        raise OptionError.seen("TRACK", " ".join(options.tracks), ", but a draw is of one track.")
    (track,) = options.tracks or ("lite",)
    draw, frozen = read_draw(folder, seed_file), frozen_beside(folder, track, name)
    with examining(options) as (work, examiner):
        work.say(f"Results are kept in {examiner.path()}")
        release = build_draw(examiner.examine, track, frozen, draw)
    write_release(release, folder)
    (folder / SEED).write_bytes(seed_file.read_bytes())
    write_overview(folder)
    print("\n".join([*overview_lines(folder), "", *verify(folder)]))
