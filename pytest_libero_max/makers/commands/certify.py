"""``libero-max dev certify``: the frozen cases that the scripted expert completes."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, add_substrate
from pytest_libero_max.makers.arguments import add_examination, add_expert, examining


def add_command(commands: Commands) -> None:
    """Add ``certify`` to the parser."""
    certify = commands.add_parser(
        "certify",
        help="Let the scripted expert play the frozen cases that have no certificate yet",
        description="Interrupted, it goes on where it stopped.",
    )
    certify.add_argument("folder", type=Path, metavar="FOLDER", help="The tracks, as build wrote them")
    certify.add_argument(
        "tracks",
        nargs="*",
        metavar="TRACK",
        help="Which tracks (default: original, max and beyond; on libero, all)",
    )
    add_expert(certify, default="expert")
    add_substrate(certify)
    add_examination(certify)
    certify.set_defaults(run=_certify)


def _certify(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.certificates import read_certificates
    from pytest_libero_max.benchmark.tracks import require_tracks
    from pytest_libero_max.makers.construction.overview import certificate_lines, write_overview
    from pytest_libero_max.makers.construction.release import add_certificates, independent_tracks

    require_tracks(options.folder)
    tracks = options.tracks or independent_tracks(options.folder)
    with examining(options) as (work, examiner):
        work.say(f"Results are kept in {examiner.path(options.expert)}")
        add_certificates(options.folder, tracks, partial(examiner.certify, expert=options.expert))
    write_overview(options.folder)
    print("\n".join(certificate_lines(read_certificates(options.folder))))
