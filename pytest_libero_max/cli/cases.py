"""``libero-max list tracks`` and ``cases``: the tracks, one of them, or one case of it."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import (
    Commands,
    add_substrate,
    manifest_of,
    option,
    substrate_options,
    switch,
    whole_number,
)
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.manifests import Manifest


def add_command(commands: Commands) -> None:
    """Add ``tracks`` and ``cases`` to the parser."""
    tracks = commands.add_parser("tracks", help="All tracks, with their numbers of cases by source")
    tracks.set_defaults(run=_tracks)

    cases = commands.add_parser("cases", help="What a track holds, or everything about one case of it")
    cases.add_argument("cases", metavar="TRACK|MANIFEST", help="A track's name or a manifest's path")
    cases.add_argument("case", nargs="?", metavar="CASE", help="Id of a case: everything about it")
    switch(cases, "--json", "The manifest's own text, unpacked")
    option(
        cases,
        "--pictures FOLDER",
        "Also write what each camera sees just before and after the event of CASE, without a policy",
        type=Path,
    )
    option(cases, "--size PX", "Side of a picture", type=whole_number(1, 4096), default=256)
    add_substrate(cases)
    cases.set_defaults(run=_cases)


def _tracks(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.track_text import track_lines
    from pytest_libero_max.benchmark.tracks import FOLDER

    say(track_lines(FOLDER))


def _cases(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.track_text import manifest_lines

    if options.pictures is not None and options.case is None:
        raise OptionError("--pictures shows the event of one case: give CASE as well.")
    manifest = manifest_of(options.cases)
    if options.json:
        print(manifest.to_json(), end="")
    elif options.case is None:
        say(manifest_lines(manifest))
    else:
        _show_case(options, manifest)


def _show_case(options: argparse.Namespace, manifest: Manifest) -> None:
    from pytest_libero_max.benchmark.certificates import read_certificates
    from pytest_libero_max.benchmark.manifests import find_case
    from pytest_libero_max.benchmark.tracks import is_manifest_path, track_path
    from pytest_libero_max.cli.case_text import case_lines, write_event_pictures
    from pytest_libero_max.substrates.registry import open_substrate

    case, name = find_case(manifest, options.case), options.cases
    certificates = {} if is_manifest_path(name) else read_certificates(track_path(name).parent)
    say(case_lines(case, certificates))
    if options.pictures is None:
        return
    with closing(open_substrate(options.substrate.name, substrate_options(options))) as substrate:
        paths = write_event_pictures(options.pictures, substrate.world(case), case, options.size)
    say(f"Written: {path}" for path in paths)
