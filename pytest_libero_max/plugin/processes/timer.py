"""A timer of the kernel that sends this process a signal, also while native code holds the interpreter.

Python's own ``signal.setitimer`` has one timer for the whole process, which adapters and pytest-timeout use.
"""

from __future__ import annotations

import ctypes
import os
import signal
from functools import cache
from typing import Any

_MONOTONIC = 1
_ABSOLUTE = 1


class _SigEvent(ctypes.Structure):
    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signo", ctypes.c_int),
        ("notify", ctypes.c_int),  # 0: a signal
        ("padding", ctypes.c_int * 12),
    )


class Timer:
    """Sends a signal to this process at a moment of ``time.monotonic()``, which no change of the date moves.

    A fork does not inherit it.

    Args:
        number: The signal.

    Raises:
        OSError: The kernel gives no timer.
    """

    def __init__(self, number: int) -> None:
        self._library = _library()
        self._id = ctypes.c_void_p()
        self._when = (ctypes.c_long * 4)()  # interval and start, each in s and ns
        event = _SigEvent(signo=number)
        if self._library.timer_create(_MONOTONIC, ctypes.byref(event), ctypes.byref(self._id)):
            raise OSError(ctypes.get_errno(), f"timer_create: {os.strerror(ctypes.get_errno())}")

    def arm(self, at: float) -> None:
        """Send the signal at this moment, and not when an earlier call said."""
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
    """The C library; in glibc before 2.34 another one has the timers."""
    for name in (None, "librt.so.1"):
        library = ctypes.CDLL(name, use_errno=True)
        if hasattr(library, "timer_create"):
            return library
    raise OSError("this system has no timer_create")


def time_signal(hard: bool) -> int:
    """The signal that ends what takes too long: a real-time one, whose default is to end the process."""
    return signal.SIGRTMIN + (10 if hard else 9)
