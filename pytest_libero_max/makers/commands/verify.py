"""``libero-max dev verify``: quotas, identities, digests and splits of the tracks."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands


def add_command(commands: Commands) -> None:
    """Add ``verify`` to the parser."""
    check = commands.add_parser("verify", help="Check quotas, identities, digests and splits of the tracks")
    check.add_argument("folder", type=Path, nargs="?", metavar="FOLDER", help="Default: the package's own")
    check.set_defaults(run=_verify)


def _verify(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.tracks import FOLDER, require_tracks
    from pytest_libero_max.makers.construction.fresh_draw import SEED
    from pytest_libero_max.makers.construction.verification import verify

    if options.folder:
        require_tracks(options.folder)
    below = sorted(path for path in FOLDER.iterdir() if path.is_dir() and not (path / SEED).exists())
    for folder in [options.folder] if options.folder else [FOLDER, *below]:
        print("\n".join(verify(folder)))
