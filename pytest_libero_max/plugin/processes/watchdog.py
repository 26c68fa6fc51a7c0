"""Time limits on the wall clock: what takes too long ends, and is never a failed episode."""

from __future__ import annotations

import faulthandler
import math
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

from pytest_libero_max.errors import LimitReached
from pytest_libero_max.plugin.processes.crash_log import Doing, LastWords, place_of, time_limit_text
from pytest_libero_max.plugin.processes.timeouts import Limits
from pytest_libero_max.plugin.processes.timer import Timer, time_signal

GRACE_S = 5.0
"""So long the session's own process has to leave what it is in, before it is ended."""


class Watchdog:
    """Ends what takes longer than a limit; a :class:`~pytest_libero_max.pairing.wall_clock.Watch`.

    A timer of the kernel sends a signal, whose handler writes the traceback of every thread and ends the
    process. Native code cannot hold it up. A process that plays pairs for a controller ends like this, and
    the controller goes on with a fresh one. The session's own process is asked first: an exception is raised
    in its main thread, and only if nothing comes of it the process ends.

    Args:
        limits: How long each may take.
        words: Where it is noted what begins; None in the session's own process.
        stderr: File descriptor for the tracebacks of the session's own process.
    """

    def __init__(self, limits: Limits, words: LastWords | None, stderr: int = 2) -> None:
        self._limits = limits
        self._words = words
        self._phase = "setup"
        self._doing = Doing()
        self._pair_ends = math.inf
        self._hard: Timer | None = None
        self._soft: Timer | None = None
        if limits == Limits():
            return
        # Without a handler before it, the signal ends the process once the tracebacks are written.
        faulthandler.register(time_signal(True), stderr if words is None else words.descriptor, chain=True)
        self._hard = Timer(time_signal(hard=True))
        if words is None:
            signal.signal(time_signal(hard=False), self._interrupt)
            self._soft = Timer(time_signal(hard=False))

    @contextmanager
    def pair(self) -> Iterator[None]:
        """The block plays a pair."""
        if self._limits.pair is not None:
            self._pair_ends = monotonic() + self._limits.pair
        try:
            self._begin("the building of the world", "step", None)
            yield
        finally:
            self._pair_ends = math.inf
            self._end_at(math.inf)

    def enter(self, phase: str) -> None:
        """A phase of the pair begins."""
        self._phase = phase
        self._note(Doing(phase, self._doing.what, self._doing.limit))

    def query(self) -> None:
        """See :class:`~pytest_libero_max.pairing.wall_clock.Watch`."""
        self._begin("a query of the policy", "query", self._limits.query)

    def step(self) -> None:
        """See :class:`~pytest_libero_max.pairing.wall_clock.Watch`."""
        self._begin("a step of the simulator", "step", self._limits.step)

    def _begin(self, what: str, name: str, limit_s: float | None) -> None:
        ends = math.inf if limit_s is None else monotonic() + limit_s
        if ends > self._pair_ends:
            ends, name, limit_s = self._pair_ends, "pair", self._limits.pair
            what = f"the pair (last seen in {what})"
        if self._doing.what != what or self._doing.phase != self._phase:
            limit = "" if limit_s is None else f"--libero-max-{name}-timeout={limit_s:g}"
            self._note(Doing(self._phase, what, limit))
        self._end_at(ends)

    def _note(self, doing: Doing) -> None:
        self._doing = doing
        if self._words is not None:
            self._words.note(doing)

    def _end_at(self, ends: float) -> None:
        if self._hard is None:
            return
        if ends == math.inf:
            for timer in (self._hard, self._soft):
                if timer is not None:
                    timer.disarm()
        elif self._soft is None:
            self._hard.arm(ends)
        else:
            self._soft.arm(ends)
            self._hard.arm(ends + GRACE_S)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        place = (
            "" if frame is None else place_of(frame.f_code.co_filename, frame.f_lineno, frame.f_code.co_name)
        )
        raise LimitReached(time_limit_text(self._doing, place))
