"""The command that follows a run from its folder: watch."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.report.following import Seen

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add ``watch`` to the parser."""
    watch = commands.add_parser(
        "watch",
        help="Follow a run from its folder, also one on another machine, until it ends",
        description="Reads the folder alone and alters nothing in it. Where standard output is no terminal, "
        "it prints lines at intervals. Exit status 11 if the run was killed or ended without every pair.",
    )
    watch.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    watch.add_argument("--once", action="store_true", help="Print the status once; do not wait")
    watch.add_argument(
        "--interval",
        type=float,
        default=2.0,
        metavar="SECONDS",
        help="Between two looks at the folder (default: %(default)s)",
    )
    watch.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> int:
    from pytest_libero_max.report.following import Follower
    from pytest_libero_max.report.live_text import LiveText, understands_sequences
    from pytest_libero_max.report.progress import Pace, progress_text

    if options.interval <= 0:
        raise OptionError(f"--interval={options.interval}, but must be more than 0 seconds.")
    follower = Follower(options.run_folder)
    seen = follower.look()
    if not options.once:
        live = LiveText(sys.stdout) if understands_sequences(sys.stdout) else None
        pace = Pace(time.monotonic())
        if live is None and seen.state in ("running", "unknown"):
            print("\n".join(seen.lines(time.time())), flush=True)
        try:
            while seen.state in ("running", "unknown"):
                if live is not None:
                    live.draw(seen.lines(time.time()))
                elif pace.due(time.monotonic()):
                    print(progress_text(seen.progress, time.time()), flush=True)
                time.sleep(options.interval)
                seen = follower.look()
        finally:
            if live is not None:
                live.erase()
    print("\n".join(seen.lines(time.time())))
    return _exit_status(seen)


def _exit_status(seen: Seen) -> int:
    from pytest_libero_max.report.exit_status import INCOMPLETE

    if seen.state == "killed" or (seen.state == "ended" and not seen.complete):
        return INCOMPLETE
    return 0
