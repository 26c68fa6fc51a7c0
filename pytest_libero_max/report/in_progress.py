"""The mark of a run that has begun and not ended: a file in the output folder, locked while the run lives.

A run that is killed cannot say so, and what it leaves behind is not a result. It leaves the mark as well,
which every reader of the folder respects.
"""

from __future__ import annotations

import fcntl
import os
import socket
from contextlib import suppress
from pathlib import Path

from pytest_libero_max.errors import DiskError, OptionError, ReportError

MARK_NAME = "in-progress"


class Mark:
    """Marks a folder as one whose run has begun, until :meth:`remove`.

    The lock goes with the process, however it ends; the file stays unless it is removed.

    Args:
        folder: An existing folder.

    Raises:
        OptionError: Another run is in progress in the folder.
        DiskError: The mark cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / MARK_NAME
        try:
            self._descriptor = self._locked()
            os.truncate(self._descriptor, 0)
            os.write(self._descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        except OSError as error:
            raise DiskError(f"Cannot write {self._path}: {error}. Is the disk full?") from error

    def remove(self) -> None:
        """The run has ended."""
        with suppress(OSError):  # the folder may be gone
            self._path.unlink()
        os.close(self._descriptor)

    def _locked(self) -> int:
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            if not _lock(descriptor):
                os.close(descriptor)
                require_free(self._path.parent)
                continue
            # The run that had it may have removed the file meanwhile.
            if self._path.exists() and os.path.samestat(os.fstat(descriptor), self._path.stat()):
                return descriptor
            os.close(descriptor)


def require_free(folder: Path) -> None:
    """Check that no run is in progress in a folder.

    Raises:
        OptionError: One is.
    """
    owner = _owner(folder)
    if owner is not None:
        raise OptionError(
            f"A run is in progress in {str(folder)!r} ({owner}). Wait until it has ended, or choose another "
            "output folder."
        )


def require_ended(folder: Path) -> None:
    """Check that what lies in a folder is the result of a run that ended.

    Raises:
        ReportError: Its run is still in progress, or was stopped before it could end.
    """
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
        f"its command again with --libero-max-resume, or remove {str(mark)!r} to use the pairs it measured."
    )


def _owner(folder: Path) -> str | None:
    """Which process holds the lock of a folder's mark; None where none does."""
    try:
        with (folder / MARK_NAME).open("rb") as file:
            return None if _lock(file.fileno()) else file.read(200).decode(errors="replace").strip()
    except OSError:
        return None


def _lock(descriptor: int) -> bool:
    """Whether the file could be locked. A file system without locks cannot tell, and counts as free."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True
