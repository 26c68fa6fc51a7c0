"""``libero-max watch``: runs followed from their folders."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, number, option, switch
from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    from pytest_libero_max.runs.status import Seen


def add_command(commands: Commands) -> None:
    """Add ``watch`` to the parser."""
    watch = commands.add_parser(
        "watch",
        help="Follow runs from their folders, also on another machine, until they end",
        description="Reads the folders alone and alters nothing in them. Where standard output is no "
        "terminal, it prints lines at intervals. Exit status 11 if a run was killed or ended without every "
        "pair.",
    )
    watch.add_argument(
        "run_folders",
        type=Path,
        nargs="+",
        metavar="RUN",
        help="The output folder of a run; of several, for example shards, there is a line each and their sum",
    )
    switch(watch, "--once", "Print the status once; do not wait")
    option(
        watch, "--interval SECONDS", "Between two looks at the folder", type=number(0.01, 3600), default=2.0
    )
    watch.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> int:
    from pytest_libero_max.runs.live_text import LiveText, understands_sequences
    from pytest_libero_max.runs.progress import Pace
    from pytest_libero_max.runs.status import Follower

    followers = [Follower(folder) for folder in options.run_folders]
    seen = [follower.look() for follower in followers]
    if not options.once:
        live = LiveText(sys.stdout) if understands_sequences(sys.stdout) else None
        pace = Pace(time.monotonic())
        if live is None and any(map(_goes_on, seen)):
            say(_lines(seen))
        try:
            while any(map(_goes_on, seen)):
                if live is not None:
                    live.draw(_lines(seen))
                elif pace.due(time.monotonic()):
                    say([_lines(seen)[-1] if len(seen) > 1 else _line(seen[0])])
                time.sleep(options.interval)
                seen = [follower.look() for follower in followers]
        finally:
            if live is not None:
                live.erase()
    say(_lines(seen))
    return max(map(_exit_status, seen))


def _goes_on(seen: Seen) -> bool:
    return seen.state in ("running", "unknown")


def _lines(runs: Sequence[Seen]) -> list[str]:
    from pytest_libero_max.runs.status import overview

    return runs[0].lines(time.time()) if len(runs) == 1 else overview(runs, time.time())


def _line(seen: Seen) -> str:
    from pytest_libero_max.runs.progress import progress_text

    return "; ".join([progress_text(seen.progress, time.time()), *seen.waiting_lines])


def _exit_status(seen: Seen) -> int:
    from pytest_libero_max.report.exit_status import INCOMPLETE

    if seen.state == "killed" or (seen.state == "ended" and not seen.complete):
        return INCOMPLETE
    return 0
