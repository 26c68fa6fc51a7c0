"""``libero-max runs --follow``: runs followed from their folders."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    from pytest_libero_max.runs.status import Seen


def follow(folders: Sequence[Path], interval_s: float, *, once: bool) -> int:
    """Show how far runs are until they end, and return the exit status."""
    from pytest_libero_max.runs.live_text import LiveText, understands_sequences
    from pytest_libero_max.runs.progress import Pace
    from pytest_libero_max.runs.status import Follower

    followers = [Follower(folder) for folder in folders]
    seen = [follower.look() for follower in followers]
    if not once:
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
                time.sleep(interval_s)
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
