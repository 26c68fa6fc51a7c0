"""``libero-max runs``: the runs below a folder, one line each."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, number, option, switch
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError, ReportError

if TYPE_CHECKING:
    from pytest_libero_max.runs.status import Seen

_FLOOR = " *"
"""Mark of a change where Base solves next to nothing."""

_HEAD = ("run", "policy", "cases", "Base", "Dynamic", "change", "status", "began (UTC)")


def add_command(commands: Commands) -> None:
    """Add ``runs`` to the parser."""
    runs = commands.add_parser(
        "runs",
        help="List the runs below a folder with their success rates, or follow runs until they end",
        description="Reads the folders alone, also of runs on another machine, and alters nothing in them. A "
        "run that is not complete has no rates. A run that cannot be read is named with the reason; exit "
        "status 1 where there is such a run. With --follow, it prints lines at intervals where standard "
        "output is no terminal; exit status 11 if a run was killed or ended without every pair.",
    )
    runs.add_argument(
        "folders",
        type=Path,
        nargs="*",
        metavar="FOLDER",
        help="Folder to look in (default: here); with --follow, the output folders of one or more runs, for "
        "example shards, which have a line each and their sum",
    )
    switch(runs, "--follow", "Show how far these runs are until they end")
    switch(runs, "--once", "With --follow: show it once; do not wait")
    option(
        runs,
        "--interval SECONDS",
        "With --follow: between two looks at the folders",
        type=number(0.01, 3600),
        default=2.0,
    )
    runs.set_defaults(run=_runs)


def _runs(options: argparse.Namespace) -> int:
    if options.follow:
        return _follow(options.folders or [Path()], options.interval, once=options.once)
    if options.once:
        raise OptionError("--once says how runs are followed. Give --follow as well.")
    if len(options.folders) > 1:
        raise OptionError.seen("FOLDER", options.folders[1], ", but one folder is looked in. Add --follow.")
    return _list(*options.folders)


def _list(folder: Path = Path()) -> int:
    from pytest_libero_max.report.render.terminal import aligned
    from pytest_libero_max.runs.status import Follower

    if not folder.is_dir():
        raise OptionError.seen("FOLDER", folder, ", but must be a folder that exists.")
    found, unreadable = [], []
    for run_folder in sorted(_run_folders(folder)):
        try:
            seen = Follower(run_folder).look()
            name = run_folder.relative_to(folder).as_posix()
            found.append((_began(seen), _row(name, seen)))
        except ReportError as error:
            unreadable.append(f"cannot be read: {error}")
    lines = aligned([_HEAD, *(row for _, row in sorted(found))]) if found else []
    if any(_FLOOR in cell for _, row in found for cell in row):
        from pytest_libero_max.report.groups import FLOOR_NOTE

        lines.append(FLOOR_NOTE)
    say([*lines, *unreadable] or [f"There is no run below {folder}."])
    return int(bool(unreadable))


def _run_folders(folder: Path) -> set[Path]:
    from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME

    return {file.parent for name in (PAIRS_NAME, PACKED_PAIRS_NAME) for file in folder.rglob(name)}


def _row(name: str, seen: Seen) -> tuple[str, ...]:
    """Return the cells of a run."""
    began = _began(seen)[:16].replace("T", " ")
    cases = seen.run.provenance["case_set"]["name"]
    return (name, seen.run.provenance["policy"]["reference"], cases, *_rates(seen), _status(seen), began)


def _began(seen: Seen) -> str:
    """Return the time at which the run began, in ISO 8601; empty where it is not recorded."""
    return str(seen.run.provenance.get("started", ""))


def _rates(seen: Seen) -> tuple[str, str, str]:
    from pytest_libero_max.report.formats import percent, points
    from pytest_libero_max.runs.outcomes import read_outcomes
    from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE

    if seen.state != "ended" or not seen.complete or not seen.progress.done:
        return ("", "", "")
    pairs = read_outcomes(seen.folder).pairs
    base, dynamic = float(pairs.base.mean()), float(pairs.dynamic.mean())
    change = int(pairs.dynamic.sum() - pairs.base.sum()) / len(pairs.base)  # as reports round it
    floor = _FLOOR if base < FLOOR_BASE_RATE else ""
    return percent(base), percent(dynamic), f"{points(change)} pp{floor}"


def _status(seen: Seen) -> str:
    from pytest_libero_max.report.formats import counted

    count = f"{seen.progress.done} of {counted(seen.progress.planned, 'pair')}"
    if seen.state != "ended":
        return f"{seen.state}, {count}"
    if seen.stopped is not None:
        return f"stopped, {count}"
    return f"complete, {counted(seen.progress.done, 'pair')}" if seen.complete else f"incomplete, {count}"


def _follow(folders: Sequence[Path], interval_s: float, *, once: bool) -> int:
    """Show how far runs are until they end, and return the exit status."""
    from pytest_libero_max.runs.live_text import LiveText, understands_sequences
    from pytest_libero_max.runs.progress import Pace
    from pytest_libero_max.runs.status import Follower

    followers = [Follower(folder) for folder in folders]
    statuses = [follower.look() for follower in followers]
    if not once:
        live = LiveText(sys.stdout) if understands_sequences(sys.stdout) else None
        pace = Pace(time.monotonic())
        if live is None and any(map(_goes_on, statuses)):
            say(_lines(statuses))
        try:
            while any(map(_goes_on, statuses)):
                if live is not None:
                    live.draw(_lines(statuses))
                elif pace.due(time.monotonic()):
                    say([_lines(statuses)[-1] if len(statuses) > 1 else _line(statuses[0])])
                time.sleep(interval_s)
                statuses = [follower.look() for follower in followers]
        finally:
            if live is not None:
                live.erase()
    say(_lines(statuses))
    return max(map(_exit_status, statuses))


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
