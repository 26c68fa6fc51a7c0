"""Waits for policy servers, noted in the folder of a run for its progress and its watchers.

A process that asks a server keeps the wait in memory, which costs a query nothing. A thread looks every
second, and notes a wait that lasts in a file of the process; the file goes when the server has answered.
"""

from __future__ import annotations

import json
import os
import platform
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec

FOLDER = "waiting"
"""Folder of the notes, in that of the run."""

NOTED_AFTER_S = 5.0
"""Time after which a wait is noted: queries take less, but for the first one of a server that compiles."""

_LOOK_S = 1.0
_HEARD_S = 60.0
"""A note that was not renewed for so long is of a process that has died."""


@dataclass
class Wait:
    """A wait for a server."""

    server: str
    patience_s: float
    """Time after which a server that cannot be reached is given up."""
    timeout_s: float | None
    """Longest time for one answer; None where it is not known."""
    why: str
    """Last trouble; empty while nothing but an answer is waited for."""
    since: float
    """Begin, seconds since the epoch."""

    def text(self, now: float) -> str:
        """Return the wait in words, with its deadline."""
        begun = f"waiting for {self.server}, {max(now - self.since, 0.0):.0f} s"
        if self.why:
            return f"{begun} (given up after {self.patience_s:g} s): {self.why}"
        return begun if self.timeout_s is None else f"{begun} (asked again after {self.timeout_s:g} s)"


class _Noter:
    """The waits of this process, and the thread that notes them."""

    def __init__(self) -> None:
        self.waits: dict[int, Wait] = {}
        self.folder: Path | None = None
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Begin to look, unless this process does."""
        if self.folder is not None and (self._thread is None or not self._thread.is_alive()):
            self._thread = threading.Thread(target=self._look, name="libero-max-waiting", daemon=True)
            self._thread.start()

    def _look(self) -> None:
        noted = False
        while True:
            time.sleep(_LOOK_S)
            folder = self.folder
            if folder is None:
                return
            now = time.time()
            lasting = [wait for wait in [*self.waits.values()] if now - wait.since >= NOTED_AFTER_S]
            if lasting or noted:
                with suppress(OSError):
                    self._note(folder / FOLDER, lasting)
            noted = bool(lasting)

    def _note(self, folder: Path, waits: list[Wait]) -> None:
        file = folder / f"{platform.node()}-{os.getpid()}.json"
        if waits:
            folder.mkdir(exist_ok=True)
            partial = file.with_suffix(".partial")
            partial.write_text(json.dumps([*map(asdict, waits)]), encoding="utf-8")
            partial.replace(file)
        else:
            file.unlink(missing_ok=True)
            with suppress(OSError):  # others wait
                folder.rmdir()


_NOTER = _Noter()


def note_in(folder: Path) -> None:
    """Note the waits of this process in the folder of a run."""
    _NOTER.folder = folder


@contextmanager
def waiting(server: str, patience_s: float, timeout_s: float | None = None) -> Iterator[Wait]:
    """Keep a wait as long as the block lasts; its reason may be changed."""
    wait = Wait(server, patience_s, timeout_s, "", time.time())
    _NOTER.begin()
    _NOTER.waits[id(wait)] = wait
    try:
        yield wait
    finally:
        del _NOTER.waits[id(wait)]


def noted_waits(folder: Path) -> list[Wait]:
    """Return the waits that processes of a run have noted in its folder, the longest first."""
    waits = []
    for file in sorted((folder / FOLDER).glob("*.json")):
        try:
            if time.time() - file.stat().st_mtime < _HEARD_S:
                waits += msgspec.json.decode(file.read_bytes(), type=list[Wait])
        except (OSError, ValueError, RecursionError):  # it went, or another version wrote it
            continue
    return sorted(waits, key=lambda wait: wait.since)


def waiting_lines(folder: Path) -> list[str]:
    """Return a line for each server that is waited for: the longest wait, and the number of the others."""
    lines, now = [], time.time()
    by_server: dict[str, list[Wait]] = {}
    for wait in noted_waits(folder):
        by_server.setdefault(wait.server, []).append(wait)
    for waits in by_server.values():
        others = f" ({len(waits)} processes)" if len(waits) > 1 else ""
        lines.append(f"{waits[0].text(now)}{others}")
    return lines


def forget_waits(folder: Path) -> None:
    """Remove the notes of a run that has ended, or of one that died here before."""
    _NOTER.folder = None
    for file in (folder / FOLDER).glob("*"):
        with suppress(OSError):
            file.unlink()
    with suppress(OSError):
        (folder / FOLDER).rmdir()
