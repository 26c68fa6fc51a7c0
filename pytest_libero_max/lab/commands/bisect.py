"""``libero-max lab bisect``: the revision or checkpoint that broke cases, found with few pairs."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option, whole_number


def add_command(commands: Commands) -> None:
    """Add ``bisect`` to the parser."""
    bisect = commands.add_parser(
        "bisect",
        help="Find the revision or checkpoint that lost cases, with as few pairs as a sequential test needs",
        description="For example: libero-max lab bisect --good v1 --bad HEAD -- adapter.py "
        "--libero-max-track=lite. Plays the good revision on all cases, the bad one until it is shown to "
        "lose more than it gains, and then revisions between them on the lost cases alone, until it is shown "
        "whether they complete more than half of them. Each revision of the repository around the current "
        "folder is checked out apart, along first parents. Each run is an ordinary one in a folder of its "
        "own, and the same command goes on where it stopped. Exit status 10 where no loss is shown.",
    )
    option(bisect, "--good REV", "Revision that completes the cases")
    option(bisect, "--bad REV", "Later one that loses them")
    option(
        bisect,
        "--checkpoints NAME",
        "Bisect these, from the good to the bad one, instead of git revisions: {} in an argument stands for "
        "the name, and so does the environment variable LIBERO_MAX_CHECKPOINT",
        nargs="+",
    )
    for end in ("good", "bad"):
        option(
            bisect,
            f"--{end}-run RUN",
            f"Folder of an earlier run of the {end} one on the same cases, which is then not played",
            type=Path,
        )
    option(bisect, "--before COMMAND", "A line of shell, run in each checked out revision before it plays")
    option(bisect, "--level P", "Of each test", type=float, default=0.05)
    option(bisect, "--seed N", "Of the order of play", type=whole_number(0), default=1)
    option(
        bisect,
        "--output FOLDER",
        "For the runs, one folder each",
        type=Path,
        default=Path("libero-max-bisect"),
    )
    bisect.add_argument(
        "arguments",
        nargs="+",
        metavar="POLICY|ARGUMENT",
        help="The policy and other arguments of pytest, after --",
    )
    bisect.set_defaults(run=_bisect)


def _bisect(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.bisection import bisect

    return bisect(options)
