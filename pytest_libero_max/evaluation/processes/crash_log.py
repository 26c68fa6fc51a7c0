"""Crash log of a process that plays pairs: its last activity, and the end of its stderr."""

from __future__ import annotations

import faulthandler
import json
import os
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TextIO

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import CrashError, LiberoMaxError, MemoryLimitError, TimeLimitError

_HEADER = 256
"""Bytes at the start of the file for the present activity; the rest is the stderr."""

_MOST_READ = 64 * 1024
"""Bytes of the end of stderr that are read."""

MEMORY = "memory"
"""Last activity of a process that wanted more memory than it may use."""

_FRAME = re.compile(r'File "(.+)", line (\d+) in (.+)')
_DUMP = re.compile(r"(Fatal Python error: |^(Current t|T)hread 0x)", re.MULTILINE)
_OUT_OF_MEMORY = "The kernel sends it to a process when the machine has no memory left, and so does kill -9."


@dataclass(frozen=True)
class Activity:
    """Activity of a process.

    Attributes:
        phase: Phase of the pair, as in its record of an error.
        what: For a message: ``a query of the policy``.
        limit: Option with the time limit that holds, and its value, for a message. Empty where none does.
    """

    phase: str = "setup"
    what: str = "the start"
    limit: str = ""


class CrashLog:
    """File that a process writes while it lives, and another one reads after its death."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        # Never closed: what an adapter logs with may keep it, and goes on writing after the pair.
        self._stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
        self._forget()
        self.note(Activity())
        faulthandler.enable(self._file)

    @property
    def descriptor(self) -> int:
        """File descriptor that handlers of signals write to."""
        return self._file

    def note(self, activity: Activity) -> None:
        """Note the activity that begins now."""
        text = json.dumps(asdict(activity)).encode()[:_HEADER]
        os.pwrite(self._file, text.ljust(_HEADER), 0)

    @contextmanager
    def capture_stderr(self) -> Iterator[None]:
        """Keep all output to stderr in the block, also by native code, and pass it on after it."""
        python = sys.stderr
        before = os.dup(2)
        try:
            os.dup2(self._file, 2)
            sys.stderr = self._stderr
            yield
        finally:
            sys.stderr = python
            os.dup2(before, 2)
            os.close(before)
            self._pass_on(python)
            self._forget()

    def _pass_on(self, stream: TextIO | None) -> None:
        size = os.lseek(self._file, 0, os.SEEK_END)
        if stream is not None and size > _HEADER:
            stream.write(os.pread(self._file, size - _HEADER, _HEADER).decode(errors="replace"))

    def _forget(self) -> None:
        os.ftruncate(self._file, _HEADER)
        os.lseek(self._file, _HEADER, os.SEEK_SET)


@dataclass(frozen=True)
class Death:
    """Death of a process that was to play a pair."""

    error: LiberoMaxError
    phase: str
    text: str

    def to_dict(self) -> Json:
        """Return JSON values for a controller on another machine."""
        return {
            "kind": type(self.error).__name__,
            "message": str(self.error),
            "phase": self.phase,
            "text": self.text,
        }

    @classmethod
    def from_dict(cls, values: Json) -> Death:
        """Read what :meth:`to_dict` returned."""
        kinds = (TimeLimitError, MemoryLimitError)
        kind = next((kind for kind in kinds if kind.__name__ == values["kind"]), CrashError)
        return cls(kind(values["message"]), values["phase"], values["text"])


def read_death(path: Path, status: int | None, who: str) -> Death:
    """Read why a process died.

    Args:
        path: Its crash log, which is missing where it lies on another machine.
        status: Its exit status, negative for a signal; None where it is not known.
        who: Its name for the message: ``worker gw1``.
    """
    activity, text = Activity(phase=""), ""
    with suppress(OSError, ValueError, TypeError):  # it died before it could write
        activity, text = _read(path)
    if status == -time_signal(hard=True) and activity.limit:
        return Death(TimeLimitError(time_limit_text(activity, _place(text))), activity.phase, text)
    if activity.what == MEMORY:
        return Death(MemoryLimitError(f"{who}: {activity.limit}"), activity.phase, text)
    place = _place(text)
    where = f" in {activity.what}" if activity.phase else ""
    last_line = _last_line(text)
    message = f"{who} {_ended(status)}{where}{_bracketed(place)}."
    if status == -signal.SIGKILL:
        message += f" {_OUT_OF_MEMORY}"
    if last_line:
        message += f" Its last line on stderr: {last_line!r}."
    # A kill comes from outside: that it met the loading of the policy says nothing about the policy.
    return Death(CrashError(message), "" if status == -signal.SIGKILL else activity.phase, text)


def time_signal(hard: bool) -> int:
    """Signal with which a time limit ends a process: a real-time one, whose default is to end it.

    Args:
        hard: True for the signal that no handler of Python's turns into an exception.
    """
    return signal.SIGRTMIN + (10 if hard else 9)


def time_limit_text(activity: Activity, place: str = "") -> str:
    """Message of a pair that a time limit ended."""
    return (
        f"{activity.what} took longer than {activity.limit} allows{_bracketed(place)}. The pair counts as "
        "not measured. Look for what hangs, or raise the limit."
    )


def _read(path: Path) -> tuple[Activity, str]:
    with path.open("rb") as file:
        activity = Activity(**json.loads(file.read(_HEADER)))
        size = file.seek(0, os.SEEK_END)
        file.seek(max(_HEADER, size - _MOST_READ))
        return activity, file.read().decode(errors="replace").replace("\0", "")


def _ended(status: int | None) -> str:
    if status is None:
        return "died"
    if status >= 0:
        return f"ended itself with exit status {status}"
    try:
        name = f" ({signal.Signals(-status).name})"
    except ValueError:
        name = ""
    return f"died of signal {-status}{name}"


def place_of(file: str, line: int | str, function: str) -> str:
    """Place in code for a message: ``adapter.py, line 12, in predict``."""
    return f"{Path(file).name}, line {line}, in {function}"


def _bracketed(place: str) -> str:
    return f" ({place})" if place else ""


def _place(text: str) -> str:
    """Innermost frame of the thread that was stopped."""
    frame = _FRAME.search(text, max(text.rfind("Current thread 0x"), 0))
    return place_of(frame[1], frame[2], frame[3]) if frame else ""


def _last_line(text: str) -> str:
    """Last line that the process itself wrote, before the tracebacks."""
    dump = _DUMP.search(text)
    lines = (text[: dump.start()] if dump else text).strip().splitlines()
    return lines[-1].strip()[:300] if lines else ""
