"""``libero-max dev field``: what the rules of conformance say of published implementations, side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.errors import OptionError

_EXAMPLE = "hf-libero=libero-max-results/conformance.json"


def add_command(commands: Commands) -> None:
    """Add ``field`` to the parser."""
    field = commands.add_parser(
        "field", help="Keep examinations of published implementations, and write their page again"
    )
    field.add_argument("folder", type=Path, metavar="FOLDER", help="Has about.toml; README.md is written")
    field.add_argument(
        "examinations", nargs="*", type=_named, metavar="NAME=FILE", help=f"To add or replace: {_EXAMPLE}"
    )
    field.set_defaults(run=_field)


def _named(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not (name and equals and file):
        raise argparse.ArgumentTypeError(f"expected NAME=FILE, for example {_EXAMPLE}")
    return name, Path(file)


def _field(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.documents import read_text
    from pytest_libero_max.conformance.results import read_conformance
    from pytest_libero_max.makers.field import (
        FIELD_NAME,
        Field,
        field_json,
        field_page,
        read_about,
        read_field,
    )

    store = options.folder / FIELD_NAME
    about = read_about(options.folder / "about.toml")
    kept = dict(read_field(read_text(store)).subjects) if store.exists() else {}
    for name, file in options.examinations:
        kept[name] = read_conformance(read_text(file))
    if unknown := kept.keys() - about.implementations.keys():
        raise OptionError(
            f"{', '.join(sorted(unknown))}: about.toml has no [implementations.NAME] of this name. Add it, "
            "with a title and notes."
        )
    field = Field(subjects={name: kept[name] for name in about.implementations if name in kept})
    store.write_text(field_json(field), encoding="utf-8")
    page = options.folder / "README.md"
    page.write_text(field_page(field, about), encoding="utf-8")
    print(f"Written: {store}, {page}")
