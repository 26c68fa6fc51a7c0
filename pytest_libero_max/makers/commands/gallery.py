"""``libero-max dev gallery``: pictures of scenes, variations and events."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, add_substrate, option, substrate_options
from pytest_libero_max.cli.work import Work

if TYPE_CHECKING:
    from pytest_libero_max.substrates.contract import Substrate


def add_command(commands: Commands) -> None:
    """Add ``gallery`` to the parser."""
    gallery = commands.add_parser(
        "gallery",
        help="Draw the embedded scenes, their variations and the events",
        description="On a substrate without sheets of its own: only the events.",
    )
    gallery.add_argument("folder", type=Path, metavar="FOLDER", help="Folder for the pictures")
    option(
        gallery,
        "--page-pictures FOLDER",
        "Also write the small pictures of events that pages of reports show, as this package has them",
        type=Path,
    )
    add_substrate(gallery)
    gallery.set_defaults(run=_gallery)


def _gallery(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.event_sheets import write_event_sheet, write_page_pictures
    from pytest_libero_max.substrates.registry import SUBSTRATES, open_substrate

    kind, settings = SUBSTRATES[options.substrate.name], substrate_options(options).for_people()
    track = kind.tracks(settings).pictured
    sheets: dict[Path, Callable[[Path, Substrate], None]] = {
        **{options.folder / name: draw for name, draw in kind.sheets.items()},
        options.folder / "events.webp": partial(write_event_sheet, track=track),
    }
    if options.page_pictures is not None:
        sheets[options.page_pictures] = partial(write_page_pictures, track=track)
    with closing(open_substrate(options.substrate.name, settings)) as substrate, Work() as work:
        for number, (path, write) in enumerate(sheets.items(), start=1):
            work.show(f"{path.name}, {number} of {len(sheets)}")
            write(path, substrate)
