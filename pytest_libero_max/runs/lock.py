"""Lock file in the output folder of a run that has begun and not ended.

A run that is killed leaves the file behind, so readers do not take its folder for a result. While the run
lives the file is locked. Its first line names the process, its second one holds the progress, for whoever
follows the run (:func:`read_mark`).
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import msgspec

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import DiskError, OptionError, ReportError

MARK_NAME = "in-progress"

_OWNER = "process"


class Mark:
    """Marks a folder as one whose run has begun, until :meth:`remove`.

    The lock goes with the process, however it ends; the file stays unless it is removed.

    Raises:
        OptionError: Another run is in progress in the folder.
        DiskError: The mark cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MARK_NAME
        self._owner = f"{_OWNER} {os.getpid()} on {socket.gethostname()}\n".encode()
        try:
            self._descriptor = self._locked()
            self._left_by_a_run = os.fstat(self._descriptor).st_size > 0
            try:
                self._write(b"")
            except OSError:
                self.abandon()
                raise
        except OSError as error:
            raise DiskError(f"Cannot write {self.path}: {error}. Is the disk full?") from error

    def note(self, progress: Json) -> None:
        """Note the progress; a full disk costs the note alone."""
        with suppress(OSError):
            self._write(msgspec.json.encode(progress) + b"\n")

    def _write(self, noted: bytes) -> None:
        content = self._owner + noted
        os.pwrite(self._descriptor, content, 0)
        os.truncate(self._descriptor, len(content))

    def remove(self) -> None:
        """Remove the mark: the run has ended."""
        with suppress(OSError):  # the folder may be gone
            self.path.unlink()
        os.close(self._descriptor)

    def abandon(self) -> None:
        """Release the lock; the mark stays where a run before this one was killed and has left it."""
        if self._left_by_a_run:
            os.close(self._descriptor)
        else:
            self.remove()

    def _locked(self) -> int:
        while True:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            if _lock(descriptor) is False:  # a file system without locks cannot tell, and counts as free
                os.close(descriptor)
                require_free(self.path.parent)
                continue
            # The run that had it may have removed the file meanwhile.
            if self.path.exists() and os.path.samestat(os.fstat(descriptor), self.path.stat()):
                return descriptor
            os.close(descriptor)


def require_free(folder: Path) -> None:
    """Check that no run is in progress in a folder, or raise OptionError."""
    owner = _owner(folder)
    if owner is not None:
        raise OptionError(
            f"A run is in progress in {str(folder)!r} ({owner}). Wait until it has ended, or choose another "
            "output folder."
        )


def require_ended(folder: Path) -> None:
    """Check that a folder holds the result of a run that ended, or raise ReportError."""
    mark = folder / MARK_NAME
    if not mark.exists():
        return
    owner = _owner(folder)
    if owner is not None:
        raise ReportError(
            f"The run in {str(folder)!r} is still in progress ({owner}). Wait until it has ended."
        )
    raise ReportError(
        f"The run in {str(folder)!r} was killed before it ended, so what is there is not its result. Give "
        "its command again with --libero-max-resume (in Python evaluate(..., resume=True), or the same "
        f"PairedRun), or remove {str(mark)!r} to use the pairs it measured."
    )


@dataclass(frozen=True)
class SeenMark:
    """The mark of a folder as another process sees it."""

    owner: str
    """Process that wrote it, and its machine."""
    locked: bool | None
    """True if a living process holds it; None where the file system does not tell."""
    here: bool
    """True if that process is one of this machine. Where it is not, and the lock is not seen, the file system
    may not tell of locks on other machines."""
    age_s: float
    """Seconds since the run last noted something."""
    noted: Json


def read_mark(folder: Path) -> SeenMark | None:
    """Return the mark of a folder; None where its run has ended or never began."""
    try:
        with _opened(folder / MARK_NAME) as file:
            free = _lock(file.fileno())
            owner, _, rest = file.read().decode(errors="replace").partition("\n")
            age_s = max(time.time() - os.fstat(file.fileno()).st_mtime, 0.0)
    except OSError:
        return None
    try:
        noted = json.loads(rest)
    except (ValueError, RecursionError):  # nothing is noted yet, or it was read while it was being written
        noted = {}
    here = owner.endswith(f" on {socket.gethostname()}")
    locked = None if free is None else not free
    return SeenMark(owner.strip(), locked, here, age_s, noted if isinstance(noted, dict) else {})


def _owner(folder: Path) -> str | None:
    """Return the process that holds the lock of a folder's mark; None where none does."""
    mark = read_mark(folder)
    return mark.owner if mark is not None and mark.locked else None


def _opened(mark: Path) -> BinaryIO:
    """Open the mark, for writing where allowed: NFS locks no file that is open for reading alone."""
    try:
        return mark.open("r+b")
    except PermissionError:
        return mark.open("rb")


def _lock(descriptor: int) -> bool | None:
    """Lock the file; return False if another process holds it, None where the file system does not tell."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True
