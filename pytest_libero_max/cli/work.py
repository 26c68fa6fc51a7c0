"""Progress of a long command: a live line on a terminal, otherwise a line at intervals."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from pytest_libero_max.runs.live_text import LiveText, understands_sequences
from pytest_libero_max.runs.progress import Pace, duration


class Work:
    """Progress on standard output. Use it in a ``with`` statement."""

    def __init__(self) -> None:
        self._live = LiveText(sys.stdout) if understands_sequences(sys.stdout) else None
        self._began = time.monotonic()
        self._pace = Pace(self._began)

    def __enter__(self) -> Work:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._erase()

    def show(self, text: str, *, last: bool = False) -> None:
        """Show the progress.

        Args:
            last: True where a part of the work is done: the line stays.
        """
        if last:
            self.say(text)
        elif self._live is not None:
            self._live.draw([text])
        elif self._pace.due(time.monotonic()):
            print(text, flush=True)

    def say(self, line: str) -> None:
        """Print a line that stays."""
        self._erase()
        print(line, flush=True)

    def left(self, done: float, total: float) -> str:
        """Return the time left at the pace so far, as words that end a line; empty where unknown."""
        if done <= 0 or done >= total:
            return ""
        seconds = time.monotonic() - self._began
        return f", {duration(seconds / done * (total - done))} left"

    def _erase(self) -> None:
        if self._live is not None:
            self._live.erase()
