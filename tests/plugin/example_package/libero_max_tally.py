"""A command of ``libero-max`` and a format of its reports, in a package of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse


def add_command(commands: Any) -> None:
    """Add ``tally`` to the parser."""
    tally = commands.add_parser("tally", help="Count the words that are given")
    tally.add_argument("words", nargs="*")
    tally.set_defaults(run=_tally)


def _tally(options: argparse.Namespace) -> None:
    print(len(options.words))


def text(run: Any, gates: Any) -> str:
    """Return the pairs of a run, one on a line: its name and 1 where Dynamic succeeds."""
    records = sorted(run.records, key=lambda record: record.item_id)
    return "".join(f"{record.item_id} {int(record.arm('dynamic').success)}\n" for record in records)
