"""``libero-max lab rerun``: recorded pairs for the viewer of Rerun, played again for it."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.film import add_pairs, write_each


def add_command(commands: Commands) -> None:
    """Add ``rerun`` to the parser."""
    rerun = commands.add_parser(
        "rerun",
        help="Write pairs of a run for the viewer of Rerun (.rrd)",
        description="The recorded actions are played again, as for films, and arms, cameras, poses, actions, "
        "queries and event are put on one timeline. Needs the extra rerun. Exit status 1 if a file was "
        "refused.",
    )
    add_pairs(rerun, "rerun")
    rerun.set_defaults(run=_rerun)


def _rerun(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.rerun_file import record_pair
    from pytest_libero_max.runs.media import RERUN_NAME

    return write_each(
        options, RERUN_NAME, lambda folder, record: folder / f"{record.item_id}.rrd", lambda ran: record_pair
    )
