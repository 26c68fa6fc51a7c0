"""Threads and processes that a policy leaves in the session's own process, which Python would wait for.

A worker ends without them. A session that plays the pairs itself ends as Python does: after all of its work,
it waits for every thread that is no daemon, and for the children of ``multiprocessing``, perhaps for ever.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

PATIENCE_S = 5.0
"""Time that what was left has to end by itself once everything else has, s."""

_POLL_S = 0.05
_MOST_NAMED = 4

_COMMANDS = ("_console_main", "console_main")
"""Functions of pytest that are its command; the second one until pytest 9.0."""

_CURE = "Let the adapter end what it starts, or start it with daemon=True."


class LeftRunning:
    """What was started while pairs were played and has not ended."""

    def __init__(self) -> None:
        self._started: list[threading.Thread | BaseProcess] = []

    @contextmanager
    def pair(self) -> Iterator[None]:
        """Play a pair in the block: what begins in it is the policy's or the simulator's."""
        before = {*_running()}
        try:
            yield
        finally:
            new = [one for one in _running() if one not in before and one not in self._started]
            self._started = [one for one in self._started if one.is_alive()] + new

    def all(self) -> list[threading.Thread | BaseProcess]:
        """Return what Python would wait for now."""
        return [one for one in self._started if one.is_alive() and not one.daemon]


_LEFT = pytest.StashKey[LeftRunning]()


def left_running(config: pytest.Config) -> LeftRunning:
    """Return what the pairs of this process leave running."""
    return config.stash.setdefault(_LEFT, LeftRunning())


def end_in_spite_of_them(config: pytest.Config, status: int) -> None:
    """Let the program end with the session, whatever its pairs have left running; say what that is.

    A program of somebody else's that calls ``pytest.main`` is told, and left as it is.

    Args:
        config: Of the session, which has nothing left to do but what other plugins do at its end.
        status: Exit status of the session.
    """
    left = left_running(config)
    if not left.all():
        return
    if not _is_program():
        print(f"libero-max: {_names(left.all())}. Python waits for them. {_CURE}", file=sys.stderr)
        return
    ending, over, closing, closed = (threading.Event() for _ in range(4))
    for target in (
        lambda: _end(left, ending, over, closing, closed),
        lambda: _leave(status, closing, closed),
    ):
        threading.Thread(target=target, name="libero-max-end", daemon=True).start()
    # Called when the interpreter ends, before it waits; and, the latest first, when it has waited.
    threading._register_atexit(ending.set)  # type: ignore[attr-defined]
    atexit.register(over.set)


def _end(
    left: LeftRunning,
    ending: threading.Event,
    over: threading.Event,
    closing: threading.Event,
    closed: threading.Event,
) -> None:
    """Wait as the interpreter does, but no longer than that for what the pairs have left."""
    ending.wait()
    ours = left.all()
    for thread in threading.enumerate():
        if thread not in ours and not thread.daemon and thread is not threading.main_thread():
            thread.join()
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until and left.all():
        time.sleep(_POLL_S)
    if not (still := left.all()):
        return
    print(f"libero-max: {_names(still)}, and end with the session. {_CURE}", file=sys.stderr, flush=True)
    for process in still:
        if not isinstance(process, threading.Thread):
            process.kill()
    if any(isinstance(one, threading.Thread) for one in still):
        closing.set()
        if not over.is_set():
            atexit._run_exitfuncs()  # files of coverage and logs, as at any other end
        closed.set()


def _leave(status: int, closing: threading.Event, closed: threading.Event) -> None:
    closing.wait()
    closed.wait(PATIENCE_S)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def _names(left: Sequence[threading.Thread | BaseProcess]) -> str:
    """Return for example ``the pairs left running: thread 'Thread-1 (listen)' and 2 more``."""
    kinds = ("process", "thread")
    named = ", ".join(
        f"{kinds[isinstance(one, threading.Thread)]} {one.name!r}" for one in left[:_MOST_NAMED]
    )
    more = len(left) - _MOST_NAMED
    return f"the pairs left running: {named}" + (f" and {more} more" if more > 0 else "")


def _running() -> list[threading.Thread | BaseProcess]:
    children = sys.modules.get("multiprocessing")
    return [*threading.enumerate(), *(children.active_children() if children is not None else ())]


def _is_program() -> bool:
    """Return True if this session is all that the program does: it was begun by pytest's own command."""
    frames = (frame for frame, _ in traceback.walk_stack(None))
    return any(
        frame.f_globals.get("__name__") == "_pytest.config" and frame.f_code.co_name in _COMMANDS
        for frame in frames
    )
