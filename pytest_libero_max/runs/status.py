"""Status of a run, read from its folder alone, also from another machine that shares it. Alters nothing."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pytest_libero_max.benchmark.documents import Json, read_content
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.policies.clients.waiting import waiting_lines
from pytest_libero_max.runs.lock import SeenMark, read_mark
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.progress import (
    PairCounts,
    Progress,
    duration,
    letters_text,
    pace_parts,
    pace_words,
    playing_lines,
    progress_text,
)
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME, PairStore, decode_line

State = Literal["running", "ended", "killed", "unknown"]

_LONGEST_S = 1e9
"""Longest plausible duration: thirty years."""

QUIET_S = 600.0
"""A run that has noted nothing for this long is said to be quiet. A pair takes seconds to minutes."""


class ProgressNotes:
    """Counts the pairs of a run, and notes in its folder how far it is, for whoever watches it."""

    def __init__(self) -> None:
        self.counts = PairCounts()
        self.playing: dict[str, float] = {}
        """Begin of each running pair, seconds since the epoch, by item id."""
        self._store: PairStore | None = None
        self._before = 0
        self._began = time.time()

    def begin(
        self, store: PairStore, planned: Sequence[PlannedPair], settled: Iterable[PairRecord | PairError]
    ) -> None:
        """Begin to note.

        Args:
            settled: Pairs of a resumed run that are not played again. One with a fault is.
        """
        self._store, self._began, self.counts.planned = store, time.time(), planned
        for pair in settled:
            self.counts.add(pair)
            self._before += isinstance(pair, PairRecord)
        self._note()

    def play(self, item_id: str) -> None:
        """Note that a pair begins."""
        if self._store is not None:
            self.playing[item_id] = time.time()
            self._note()

    def stored(self, pair: PairRecord | PairError) -> None:
        """Count a stored pair."""
        self.counts.add(pair)
        self.playing.pop(pair.item_id, None)
        self._note()

    @property
    def progress(self) -> Progress:
        """The progress now."""
        now = time.time()
        playing = {name: now - begun for name, begun in self.playing.items()}
        return Progress(self.counts.to_play, self.counts, self._before, now - self._began, playing)

    @property
    def goes_on(self) -> bool:
        """True while pairs are left to play."""
        return self._store is not None and len(self.counts.letters) < self.counts.to_play

    def _note(self) -> None:
        if self._store is not None:
            times: Json = {"began": self._began, "now": time.time()}
            self._store.note({**times, "before": self._before, "playing": dict(self.playing)})


@dataclass(frozen=True)
class Seen:
    """Status of a run at one moment."""

    folder: Path
    run: Run
    progress: Progress
    mark: SeenMark | None
    stopped: Stopped | None = None
    """Reason it was stopped, if nothing was played after that."""

    @property
    def state(self) -> State:
        """State of the run. ``unknown``: its lock, or that of another machine, may not be seen from here."""
        if self.mark is None:
            return "ended"
        if self.mark.locked:
            return "running"
        return "killed" if self.mark.here and self.mark.locked is False else "unknown"

    @property
    def complete(self) -> bool:
        """True if every planned pair is measured, or a rule stopped the run and no pair is an error."""
        counts = self.progress.counts
        if self.stopped is not None and self.stopped.rule is not None:
            return counts.measured == self.progress.done
        return counts.measured >= self.progress.planned

    def lines(self, now: float | None = None) -> list[str]:
        """Return human-readable status lines."""
        progress = self.progress
        policy = self.run.provenance["policy"]["reference"]
        lines = [
            f"{self.folder}: {policy} on {self.run.provenance['case_set']['name']}, {self._state_text()}"
        ]
        pace = pace_parts(progress, now) if self._seems_to_play else []
        lines.append(", ".join([f"{progress.done} of {counted(progress.planned, 'pair')}", *pace]))
        lines.append(letters_text(progress.counts))
        if self._seems_to_play:
            lines += [*playing_lines(progress), *self.waiting_lines]
        return lines

    @property
    def waiting_lines(self) -> list[str]:
        """Lines on servers that are waited for; none of a run that does not play."""
        return waiting_lines(self.folder) if self._seems_to_play else []

    @property
    def _seems_to_play(self) -> bool:
        """True if it plays, or did a short while ago where its lock cannot be seen."""
        heard = self.mark is not None and self.mark.age_s <= QUIET_S
        return self.state == "running" or (self.state == "unknown" and heard)

    def _state_text(self) -> str:
        if self.mark is None:
            words = "ended" if self.complete else f"ended incomplete: {self._lacks()}"
            return words if self.stopped is None else f"{words}, {self.stopped.text}"
        owner, ago = self.mark.owner, duration(self.mark.age_s)
        if self.state == "running":
            return f"running ({owner})" + (f", quiet for {ago}" if self.mark.age_s > QUIET_S else "")
        if self.state == "unknown":
            return (
                f"last heard of {ago} ago ({owner}). Whether that process still plays cannot be seen "
                "from here"
            )
        return f"killed before it ended ({owner}, {ago} ago). Give its command again with --libero-max-resume"

    def _lacks(self) -> str:
        missing = self.progress.planned - self.progress.done
        errors = self.progress.done - self.progress.counts.measured
        words = [f"{missing} missing"] if missing else []
        return ", ".join(words + ([f"{errors} with an error"] if errors else []))


def overview(runs: Sequence[Seen], now: float | None = None) -> list[str]:
    """Return a line for each of several runs, for example shards, and a line for all of them."""
    lines = [
        "; ".join([f"{seen.lines()[0]}, {progress_text(seen.progress)}", *seen.waiting_lines])
        for seen in runs
    ]
    together = PairCounts()
    for seen in runs:  # the same pair may be one of several runs
        counts = seen.progress.counts
        together.letters |= {f"{seen.folder} {name}": letter for name, letter in counts.letters.items()}
        together.errors += counts.errors
    playing = [seen.progress for seen in runs if seen.state == "running"]
    pace = sum(progress.per_minute or 0.0 for progress in playing)
    left = max((progress.seconds_left or 0.0 for progress in playing), default=0.0)
    words = [
        f"{len(together.letters)} of {counted(sum(seen.progress.planned for seen in runs), 'pair')} of "
        f"{counted(len(runs), 'run')}"
    ]
    words += pace_words(pace, left, now) if pace else []
    return [*lines, ", ".join([*words, letters_text(together)])]


class Follower:
    """Reads the pairs of a run as they are written, each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._begin_again()

    def _begin_again(self) -> None:
        self._file: tuple[int, int] | None = None
        self._read = 0
        self._lines = 0
        self._run: Run | None = None
        self._counts = PairCounts()
        self._stopped: Stopped | None = None

    def look(self) -> Seen:
        """Return the present status, or raise ReportError."""
        mark = read_mark(self._folder)  # first: what is written before it goes is all there is
        self._read_on()
        if self._run is None:
            raise ReportError(
                f"{self._folder} holds no run that has begun. Give the output folder of one "
                f"(--libero-max-output, in which {PAIRS_NAME} is)."
            )
        return Seen(self._folder, self._run, self._progress(mark), mark, self._stopped)

    def _progress(self, mark: SeenMark | None) -> Progress:
        planned = self._counts.to_play
        noted = {} if mark is None else mark.noted
        try:
            began, now = float(noted["began"]), float(noted["now"])
            since = {str(name): now - float(begun) for name, begun in noted["playing"].items()}
            before = int(noted["before"])
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError):
            return Progress(planned, self._counts)
        if not all(abs(number) < _LONGEST_S for number in (now - began, before, *since.values())):
            return Progress(planned, self._counts)  # no clock says that, NaN included
        age_s = mark.age_s if mark is not None else 0.0
        playing = {name: seconds + age_s for name, seconds in since.items()}
        return Progress(planned, self._counts, before, now - began + age_s, playing)

    def _read_on(self) -> None:
        plain, packed = self._folder / PAIRS_NAME, self._folder / PACKED_PAIRS_NAME
        try:
            if packed.exists() and not plain.exists():
                self._begin_again()
                self._take(read_content(packed))
                return
            with plain.open("rb") as file:
                status = os.fstat(file.fileno())
                if self._file != (status.st_dev, status.st_ino) or status.st_size < self._read:
                    self._begin_again()  # another run has begun in the folder
                    self._file = status.st_dev, status.st_ino
                file.seek(self._read)
                self._take(file.read())
        except FileNotFoundError:
            self._begin_again()
        except (OSError, ValueError) as error:
            raise ReportError(f"Cannot read the pairs in {self._folder}: {error}.") from error

    def _take(self, content: bytes) -> None:
        """Read the complete lines that have been added."""
        whole = content[: content.rfind(b"\n") + 1]
        for line in whole.splitlines():
            self._lines += 1
            try:
                value = decode_line(line)
                self._stopped = value if isinstance(value, Stopped) else None
                if isinstance(value, Run):
                    self._run = value
                    self._counts.planned = value.planned
                elif not isinstance(value, Stopped):
                    self._counts.add(value)
            except ReportError as error:
                raise ReportError(f"{self._folder / PAIRS_NAME}, line {self._lines}: {error}") from error
        self._read += len(whole)
