"""Time limits on the wall clock: an activity that takes too long is ended, and is never a failed episode."""

from __future__ import annotations

import ctypes
import faulthandler
import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from time import monotonic
from types import FrameType
from typing import Any

from pytest_libero_max.errors import LimitReached
from pytest_libero_max.evaluation.processes.crash_log import (
    Activity,
    CrashLog,
    place_of,
    time_limit_text,
    time_signal,
)

GRACE_S = 5.0
"""Time for the session's own process to react to the exception before it is ended, s."""

_MONOTONIC = 1
_ABSOLUTE = 1


@dataclass(frozen=True)
class Limits:
    """Longest wall-clock time of each activity, s; None for no limit.

    Attributes:
        query: A call of the policy.
        step: Work of the simulator between two calls of the watch: a step, a reset, images.
        pair: All arms of a pair. The loading of the policy is not part of it.
    """

    query: float | None = None
    step: float | None = None
    pair: float | None = None


class _SigEvent(ctypes.Structure):
    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signo", ctypes.c_int),
        ("notify", ctypes.c_int),  # 0: a signal
        ("padding", ctypes.c_int * 12),
    )


class Timer:
    """A timer of the kernel that sends this process a signal, also while native code holds the interpreter.

    Python's own ``signal.setitimer`` has one timer for the whole process, which adapters and pytest-timeout
    use. Times are those of ``time.monotonic()``, which no change of the date moves. A fork inherits no timer.
    """

    def __init__(self, number: int) -> None:
        self._library = _library()
        self._id = ctypes.c_void_p()
        self._when = (ctypes.c_long * 4)()  # interval and start, each in s and ns
        event = _SigEvent(signo=number)
        if self._library.timer_create(_MONOTONIC, ctypes.byref(event), ctypes.byref(self._id)):
            raise OSError(ctypes.get_errno(), f"timer_create: {os.strerror(ctypes.get_errno())}")

    def arm(self, at: float) -> None:
        """Send the signal at this time, and not at that of an earlier call."""
        self._when[2] = int(at)
        self._when[3] = int(at % 1 * 1e9)
        self._set()

    def disarm(self) -> None:
        """Send none."""
        self._when[2] = self._when[3] = 0
        self._set()

    def _set(self) -> None:
        self._library.timer_settime(self._id, _ABSOLUTE, self._when, None)


@cache
def _library() -> Any:
    """Return the C library; in glibc before 2.34 another one has the timers."""
    for name in (None, "librt.so.1"):
        library = ctypes.CDLL(name, use_errno=True)
        if hasattr(library, "timer_create"):
            return library
    raise OSError("this system has no timer_create")


class Watchdog:
    """Ends an activity that exceeds its limit; a :class:`~pytest_libero_max.pairing.wall_clock.Watch`.

    A timer of the kernel sends a signal, whose handler writes the traceback of every thread and ends the
    process. Native code cannot hold it up. A process that plays pairs for a controller ends like this, and
    the controller goes on with a fresh one. The session's own process is asked first: an exception is raised
    in its main thread, and the process is ended only if that has no effect.
    """

    def __init__(self, limits: Limits, log: CrashLog | None, stderr: int = 2) -> None:
        self._limits = limits
        self._log = log
        self._phase = "setup"
        self._activity = Activity()
        self._pair_ends = math.inf
        self._hard: Timer | None = None
        self._soft: Timer | None = None
        if limits == Limits():
            return
        # Without a handler before it, the signal ends the process once the tracebacks are written.
        faulthandler.register(time_signal(True), stderr if log is None else log.descriptor, chain=True)
        self._hard = Timer(time_signal(hard=True))
        if log is None:
            signal.signal(time_signal(hard=False), self._interrupt)
            self._soft = Timer(time_signal(hard=False))

    @contextmanager
    def pair(self) -> Iterator[None]:
        """Play a pair in the block, within its time limit."""
        if self._limits.pair is not None:
            self._pair_ends = monotonic() + self._limits.pair
        try:
            self._begin("the building of the world", "step", None)
            yield
        finally:
            self._pair_ends = math.inf
            self._end_at(math.inf)

    def enter(self, phase: str) -> None:
        """Begin a phase of the pair."""
        self._phase = phase
        self._note(Activity(phase, self._activity.what, self._activity.limit))

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
        if self._activity.what != what or self._activity.phase != self._phase:
            limit = "" if limit_s is None else f"--libero-max-timeout={name}:{limit_s:g}"
            self._note(Activity(self._phase, what, limit))
        self._end_at(ends)

    def _note(self, activity: Activity) -> None:
        self._activity = activity
        if self._log is not None:
            self._log.note(activity)

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
        raise LimitReached(time_limit_text(self._activity, place))
