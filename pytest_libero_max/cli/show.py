"""``libero-max show``: the tracks, one of them, or one case of it."""

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
    """Add ``show`` to the parser."""
    show = commands.add_parser("show", help="Show the tracks, one of them, or one case of it")
    show.add_argument("cases", nargs="?", metavar="TRACK|MANIFEST", help="Without: all tracks")
    show.add_argument("case", nargs="?", metavar="CASE", help="Id of a case: everything about it")
    switch(show, "--json", "The manifest's own text, unpacked")
    option(
        show,
        "--pictures FOLDER",
        "Also write what each camera sees just before and after the event of CASE, without a policy",
        type=Path,
    )
    option(show, "--size PX", "Side of a picture", type=whole_number(1, 4096), default=256)
    add_substrate(show)
    show.set_defaults(run=_show)


def _show(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.track_text import manifest_lines, track_lines
    from pytest_libero_max.benchmark.tracks import FOLDER

    if options.pictures is not None and options.case is None:
        raise OptionError("--pictures shows the event of one case: give TRACK and CASE as well.")
    if options.cases is None:
        say(track_lines(FOLDER))
        return
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
    with closing(open_substrate(options.substrate, substrate_options(options))) as substrate:
        paths = write_event_pictures(options.pictures, substrate.world(case), case, options.size)
    say(f"Written: {path}" for path in paths)
