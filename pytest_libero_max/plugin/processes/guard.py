"""What guards the process that plays pairs: time limits, a memory limit, and last words if it dies."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import pytest

from pytest_libero_max.errors import LimitReached, MemoryLimitError, TimeLimitError
from pytest_libero_max.machine import GIB, limit_private_bytes, memory_bytes, return_large_blocks
from pytest_libero_max.plugin.collection import settings_of
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.processes.crash_log import MEMORY, Doing, LastWords
from pytest_libero_max.plugin.processes.watchdog import Watchdog
from pytest_libero_max.substrates.registry import SUBSTRATES

WORDS_INPUT = "libero_max_words"
"""In a worker's input: the path of its last words."""

OUT_OF_MEMORY = 70
"""Exit status of a process that wanted more memory than it may use."""

SHARE = 0.9
"""Of the memory of the machine, what its processes may use together by default."""

_GUARD = pytest.StashKey["Guard"]()


class Guard:
    """Guards this process. Its limits hold from now on, and for the processes that it starts.

    Args:
        settings: The limits.
        workers: How many processes share the memory of the machine.
        words: Where its last words go; None in the session's own process, whose death ends the session.
        stderr: Where the session's own process writes the tracebacks of a hard end to.
    """

    def __init__(self, settings: Settings, workers: int, words: LastWords | None, stderr: int = 2) -> None:
        self.phase = "setup"
        return_large_blocks()
        self.watchdog = Watchdog(settings.timeouts, words, stderr)
        self._words = words
        self._memory_gib = memory_gib(settings.memory, workers, SUBSTRATES[settings.substrate].limit_gib)
        if self._memory_gib is not None:
            limit_private_bytes(int(self._memory_gib * GIB))

    @property
    def own_session(self) -> bool:
        """Whether this is the session's own process."""
        return self._words is None

    @contextmanager
    def pair(self) -> Iterator[None]:
        """The block plays a pair."""
        with nullcontext() if self._words is None else self._words.hearing():
            try:
                yield
            except Exception as error:
                if self._words is not None and self._is_memory(error):
                    self._words.note(Doing(self.phase, MEMORY, self._memory_text()))
                    os._exit(OUT_OF_MEMORY)  # nobody knows what holds the memory; a fresh process has it free
                raise

    def enter(self, phase: str) -> None:
        """A phase of the pair begins."""
        self.phase = phase
        self.watchdog.enter(phase)

    def ended_by(self, error: BaseException) -> TimeLimitError | MemoryLimitError | None:
        """The limit that ended a pair with this error, after which this process is not to be trusted."""
        if isinstance(error, LimitReached):
            return TimeLimitError(str(error))
        if self._is_memory(error):
            return MemoryLimitError(f"the session: {self._memory_text()}")
        return None

    def _is_memory(self, error: BaseException) -> bool:
        if self._memory_gib is None:
            return False
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, MemoryError):
            cause = cause.__cause__ or cause.__context__
        return cause is not None

    def _memory_text(self) -> str:
        return (
            f"more than {self._memory_gib:.1f} GiB of memory were asked for. Look for what grows, play with "
            "fewer workers, or set --libero-max-memory."
        )


def memory_gib(asked: float | None, workers: int, least: float) -> float | None:
    """The memory limit of a process, GiB; None for no limit.

    Args:
        asked: What the option says: 0 for no limit, None for a share of the machine.
        workers: How many processes share it.
        least: Limit below which no share of the machine goes, GiB; what the substrate needs.
    """
    if asked is None:
        return max(least, SHARE * memory_bytes() / GIB / workers)
    return asked or None


def guard_of(config: pytest.Config) -> Guard:
    """The guard of this process, which begins here at its first call."""
    if _GUARD not in config.stash:
        settings = settings_of(config)
        worker = getattr(config, "workerinput", None)
        if worker is None:
            config.stash[_GUARD] = Guard(settings, 1, None, _stderr(config))
        else:
            path = Path(worker.get(WORDS_INPUT, ""))
            if not path.parent.is_dir() or not path.name:  # the controller is on another machine
                path = Path(tempfile.mkdtemp(), "words")
            config.stash[_GUARD] = Guard(settings, int(worker["workercount"]), LastWords(path))
    return config.stash[_GUARD]


STDERR = pytest.StashKey[int]()
"""On the config: stderr as it was before pytest captures it."""


def _stderr(config: pytest.Config) -> int:
    return config.stash.get(STDERR, 2)
