"""How far a run is, counted from what is known of its pairs so far, and said in a line.

No rate of success is computed: a run that is not complete has none.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.runs.outcome_letters import ALL_LETTERS, ERROR, letter_of
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.work_left import WorkLeft


@dataclass
class PairCounts:
    """The letter of each pair that is known.

    Attributes:
        planned: The pairs of the run.
        letters: By item id. A pair that was measured after an error has the letter of its record.
        errors: How many errors there were, those of pairs that were measured afterwards included.
    """

    planned: Sequence[PlannedPair] = ()
    letters: dict[str, str] = field(default_factory=dict)
    errors: int = 0
    _unsupported: int | None = None
    _work: WorkLeft | None = None

    @property
    def work(self) -> WorkLeft:
        """What is left to do of the planned pairs."""
        if self._work is None:
            self._work = WorkLeft(self.planned)
        return self._work

    def add(self, pair: PairRecord | PairError) -> None:
        """Count a pair, or an error in its place."""
        if pair.item_id not in self.letters:
            self.work.remove(pair.item_id)
        if isinstance(pair, PairRecord):
            self.work.learn(pair)
            self.letters[pair.item_id] = letter_of(pair)
            if self._unsupported is None:
                self._unsupported = len(unsupported_pairs(self.planned, pair.policy))
        else:
            self.errors += 1
            self.letters.setdefault(pair.item_id, ERROR)

    @property
    def measured(self) -> int:
        """How many pairs are measured."""
        return sum(letter != ERROR for letter in self.letters.values())

    @property
    def to_play(self) -> int:
        """How many pairs are to be played: not those of suites that the policy declares unsupported.

        What it declares is known from its first pair on.
        """
        return len(self.planned) - (self._unsupported or 0)


@dataclass(frozen=True)
class Progress:
    """How far a run is at one moment.

    Attributes:
        planned: Pairs to play in all.
        counts: The pairs that are measured, or are errors.
        before: How many of them a resumed run had already.
        seconds: Since this session began to play; None where that is not known.
        playing: For how many seconds each pair has been played that is being played, by item id.
        workers: Which worker plays it, by item id, where there are several.
    """

    planned: int
    counts: PairCounts
    before: int = 0
    seconds: float | None = None
    playing: Mapping[str, float] = field(default_factory=dict)
    workers: Mapping[str, str] = field(default_factory=dict)

    @property
    def done(self) -> int:
        """Pairs that are measured, or are errors."""
        return len(self.counts.letters)

    @property
    def per_minute(self) -> float | None:
        """Pairs a minute in this session; None before the first one."""
        now = self.done - self.before
        return 60.0 * now / self.seconds if self.seconds and now > 0 else None

    @property
    def seconds_left(self) -> float | None:
        """As the measured pairs let expect it of the others; None where nothing is known yet.

        Where their costs are not known, at the pace of this session.
        """
        if self.seconds:
            left = self.counts.work.seconds_left(self.before, self.seconds, self.playing)
            if left is not None:
                return left
        pace = self.per_minute
        return None if pace is None else 60.0 * max(self.planned - self.done, 0) / pace


def progress_text(progress: Progress, now: float | None = None) -> str:
    """One line: pairs done, pace, time left, outcomes, errors.

    Args:
        progress: What is said.
        now: Seconds since the epoch, for when the run will be ready; None: leave that out.
    """
    parts = [f"{progress.done} of {progress.planned} pairs", *pace_parts(progress, now)]
    return ", ".join([*parts, letters_text(progress.counts)])


def pace_parts(progress: Progress, now: float | None = None) -> list[str]:
    """Pace and time left, as far as they are known; nothing of a run that has nothing left to do."""
    left = progress.seconds_left
    return [] if left is None else pace_words(progress.per_minute, left, now)


def pace_words(per_minute: float | None, seconds_left: float, now: float | None = None) -> list[str]:
    """Pace and time left.

    Args:
        per_minute: Pairs a minute; None where this session has measured none.
        seconds_left: 0 where nothing is left to do, which is not said.
        now: Seconds since the epoch, for when it will be ready; None: leave that out.
    """
    parts = [] if per_minute is None else [f"{per_minute:.1f}/min"]
    if seconds_left > 0:
        ready = "" if now is None else f" (ready at {_clock(now, seconds_left)})"
        parts.append(f"{duration(seconds_left)} left{ready}")
    return parts


def letters_text(counts: PairCounts) -> str:
    """How many pairs have each letter; those of no pair are left out, but never P, R, N and E."""
    found = Counter(counts.letters.values())
    always = ("P", "R", "N", ERROR)
    words = [f"{letter} {found[letter]}" for letter in ALL_LETTERS if found[letter] or letter in always]
    mended = counts.errors - found[ERROR]
    if mended > 0:
        words.append(f"({mended} more error{'s' if mended > 1 else ''}, played again)")
    return " ".join(words)


def playing_lines(progress: Progress) -> list[str]:
    """A line for each pair that is being played, the longest first."""
    by_time = sorted(progress.playing.items(), key=lambda item: -item[1])
    return [
        f"{progress.workers.get(name, '')} playing for {duration(seconds)}: {name}".strip()
        for name, seconds in by_time
    ]


def duration(seconds: float) -> str:
    """A time as people say it: ``40 s``, ``12 min``, ``3 h 05 min``."""
    if seconds < 90.0:
        return f"{max(seconds, 0.0):.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


def _clock(now: float, seconds: float) -> str:
    """Time of the day so many seconds after now; with the date where it is not today."""
    then, today = time.localtime(now + seconds), time.localtime(now)
    return time.strftime("%H:%M" if then[:3] == today[:3] else "%m-%d %H:%M", then)


class Pace:
    """Says when the next line about long work is due where lines stay: not too many of them.

    After a minute, then every minute; after ten minutes at every tenth of the time that has passed; at least
    every ten minutes.

    Args:
        began: Seconds of a clock.
    """

    def __init__(self, began: float) -> None:
        self._began = self._last = began

    def due(self, now: float) -> bool:
        """Whether a line is due; the next one is counted from then."""
        if now - self._last < min(max(60.0, 0.1 * (now - self._began)), 600.0):
            return False
        self._last = now
        return True
