"""Progress of a run, counted from the pairs known so far, as a line of text, and each pair as a letter.

No rate of success is computed: a run that is not complete has none.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pytest_libero_max.errors import counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs

LETTERS = {
    "preserved_success": "P",
    "change_associated_success": "G",
    "regression": "R",
    "persistent_failure": "N",
}
"""Both arms succeed, only Dynamic (a gain), only Base (a regression), neither. ``U`` is a pair whose event
never fired, and an error keeps pytest's own ``E``."""

UNTRIGGERED = "U"
ERROR = "E"

ALL_LETTERS = (*LETTERS.values(), UNTRIGGERED, ERROR)

_WORDS = {
    "preserved_success": "PRESERVED",
    "change_associated_success": "GAINED",
    "regression": "REGRESSION",
    "persistent_failure": "NEITHER",
}


@dataclass
class PairCounts:
    """The letter of each pair that is known."""

    planned: Sequence[PlannedPair] = ()
    letters: dict[str, str] = field(default_factory=dict)
    """By item id. A pair that was measured after an error has the letter of its record."""
    errors: int = 0
    """Number of errors, those of pairs that were measured afterwards included."""
    _unsupported: int | None = None

    def add(self, pair: PairRecord | PairError) -> None:
        """Count a pair, or an error in its place."""
        if isinstance(pair, PairRecord):
            self.letters[pair.item_id] = letter_of(pair)
            if self._unsupported is None:
                self._unsupported = len(unsupported_pairs(self.planned, pair.policy))
        else:
            self.errors += 1
            self.letters.setdefault(pair.item_id, ERROR)

    @property
    def measured(self) -> int:
        """Number of measured pairs."""
        return sum(letter != ERROR for letter in self.letters.values())

    @property
    def to_play(self) -> int:
        """Number of pairs to play: not those of suites that the policy declares unsupported.

        The policy's declaration is known from its first pair on.
        """
        return len(self.planned) - (self._unsupported or 0)


@dataclass(frozen=True)
class Progress:
    """Progress of a run at one moment."""

    planned: int
    counts: PairCounts
    before: int = 0
    """Number of pairs that a resumed run had already."""
    seconds: float | None = None
    """Seconds since this session began to play; None where unknown."""
    playing: Mapping[str, float] = field(default_factory=dict)
    """Seconds that each running pair has been played, by item id."""

    @property
    def done(self) -> int:
        """Number of pairs that are measured, or are errors."""
        return len(self.counts.letters)

    @property
    def per_minute(self) -> float | None:
        """Pairs a minute in this session; None before the first one."""
        now = self.done - self.before
        return 60.0 * now / self.seconds if self.seconds and now > 0 else None

    @property
    def seconds_left(self) -> float | None:
        """Seconds left at the pace of this session; None before its first pair."""
        pace = self.per_minute
        return None if pace is None else 60.0 * max(self.planned - self.done, 0) / pace


def progress_text(progress: Progress, now: float | None = None) -> str:
    """Return one line: pairs done, outcomes, errors, pace, time left. A narrow terminal cuts its end off.

    Args:
        now: Seconds since the epoch, for when the run will be ready; None: leave that out.
    """
    done = f"{progress.done} of {counted(progress.planned, 'pair')}"
    return ", ".join([done, letters_text(progress.counts), *pace_parts(progress, now)])


def pace_parts(progress: Progress, now: float | None = None) -> list[str]:
    """Return pace and time left, as far as they are known; nothing for a run without pairs left."""
    left = progress.seconds_left
    return [] if left is None else pace_words(progress.per_minute, left, now)


def pace_words(per_minute: float | None, seconds_left: float, now: float | None = None) -> list[str]:
    """Return pace and time left in words."""
    parts = [] if per_minute is None else [f"{per_minute:.1f}/min"]
    if seconds_left > 0:
        ready = "" if now is None else f" (ready at {_clock(now, seconds_left)})"
        parts.append(f"{duration(seconds_left)} left{ready}")
    return parts


def letters_text(counts: PairCounts) -> str:
    """Return the number of pairs of each letter; letters of no pair are left out, except P, R, N and E."""
    found = Counter(counts.letters.values())
    always = ("P", "R", "N", ERROR)
    words = [f"{letter} {found[letter]}" for letter in ALL_LETTERS if found[letter] or letter in always]
    mended = counts.errors - found[ERROR]
    if mended > 0:
        words.append(f"({mended} more error{'s' if mended > 1 else ''}, played again)")
    return " ".join(words)


def playing_lines(progress: Progress) -> list[str]:
    """Return a line for each running pair, the longest first."""
    by_time = sorted(progress.playing.items(), key=lambda item: -item[1])
    return [f"playing for {duration(seconds)}: {name}" for name, seconds in by_time]


def duration(seconds: float) -> str:
    """Return a duration in words: ``40 s``, ``12 min``, ``3 h 05 min``."""
    if seconds < 90.0:
        return f"{max(seconds, 0.0):.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


def _clock(now: float, seconds: float) -> str:
    """Return the time of day ``seconds`` after now; with the date where it is not today."""
    then, today = time.localtime(now + seconds), time.localtime(now)
    return time.strftime("%H:%M" if then[:3] == today[:3] else "%m-%d %H:%M", then)


class Pace:
    """Schedule of the lines about long work on output that scrolls.

    After a minute, then every minute; after ten minutes at every tenth of the time that has passed; at least
    every ten minutes.
    """

    def __init__(self, began: float) -> None:
        self._began = self._last = began

    def due(self, now: float) -> bool:
        """Return True if a line is due; the next one is counted from now."""
        if now - self._last < min(max(60.0, 0.1 * (now - self._began)), 600.0):
            return False
        self._last = now
        return True


def letter_of(pair: PairRecord) -> str:
    """Return the letter of a measured pair."""
    return LETTERS[pair.outcome] if pair.triggered else UNTRIGGERED


def status(pair: PairRecord) -> tuple[str, str, str]:
    """Category (pytest's), letter and word for a measured pair."""
    return "passed", letter_of(pair), sentence(pair)


def sentence(pair: PairRecord) -> str:
    """Return the outcome of a pair on one line."""
    base = f"Base {_arm(pair.base_success, pair.base_steps)}"
    if not pair.triggered:
        return f"UNTRIGGERED ({base}, never within reach: {pair.min_distance_m:.2f} m at best)"
    dynamic = f"Dynamic {_arm(pair.dynamic_success, pair.dynamic_steps)}"
    stale = f"{pair.stale_actions} stale action" + ("" if pair.stale_actions == 1 else "s")
    return f"{_WORDS[pair.outcome]} ({base}, event at step {pair.trigger_step}, {stale}, {dynamic})"


def _arm(success: bool, steps: int) -> str:
    return f"{'succeeds' if success else 'fails'} after {steps}"
