"""Process that plays pairs: its time limits, its memory limit, its crash log."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext

from pytest_libero_max.errors import LimitReached, MemoryLimitError, TimeLimitError
from pytest_libero_max.evaluation.processes.crash_log import MEMORY, Activity, CrashLog
from pytest_libero_max.evaluation.processes.time_limits import Limits, Watchdog
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.machine import GIB, limit_private_bytes, memory_bytes, return_large_blocks
from pytest_libero_max.substrates.registry import SUBSTRATES

OUT_OF_MEMORY = 70
"""Exit status of a process that wanted more memory than it may use."""

SHARE = 0.9
"""Share of the machine's memory that its processes may use together by default."""


class Playing:
    """The process that plays a pair, as far as the pair is concerned: without limits."""

    def __init__(self, watchdog: Watchdog | None = None) -> None:
        self.phase = "setup"
        self.watchdog = watchdog or Watchdog(Limits(), None)

    @contextmanager
    def pair(self) -> Iterator[None]:
        """Play a pair in the block."""
        yield

    def enter(self, phase: str) -> None:
        """Begin a phase of the pair."""
        self.phase = phase
        self.watchdog.enter(phase)

    def ended_by(self, error: BaseException) -> TimeLimitError | MemoryLimitError | None:
        """Return the limit that ended a pair with this error; this process is then not to be trusted."""
        return None


class PairProcess(Playing):
    """This process with its limits, which hold from now on, and for the processes that it starts.

    Args:
        workers: Number of processes that share the memory of the machine.
        log: Its crash log; None in the session's own process, whose death ends the session.
        stderr: File descriptor for the tracebacks of the session's own process.
    """

    def __init__(self, settings: Settings, workers: int, log: CrashLog | None, stderr: int = 2) -> None:
        super().__init__(Watchdog(settings.timeout, log, stderr))
        return_large_blocks()
        self._log = log
        self._memory_gib = memory_gib(settings.memory, workers, SUBSTRATES[settings.substrate.name].limit_gib)
        if self._memory_gib is not None:
            limit_private_bytes(int(self._memory_gib * GIB))

    @contextmanager
    def pair(self) -> Iterator[None]:
        with nullcontext() if self._log is None else self._log.capture_stderr():
            try:
                yield
            except Exception as error:
                if self._log is not None and self._is_memory(error):
                    self._log.note(Activity(self.phase, MEMORY, self._memory_text()))
                    os._exit(OUT_OF_MEMORY)  # nobody knows what holds the memory; a fresh process has it free
                raise

    def ended_by(self, error: BaseException) -> TimeLimitError | MemoryLimitError | None:
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
    """Memory limit of a process, GiB; None for no limit.

    Args:
        asked: Value of the option: 0 for no limit, None for a share of the machine.
        workers: Number of processes that share it.
        least: Limit below which no share of the machine goes, GiB; what the substrate needs.
    """
    if asked is None:
        return max(least, SHARE * memory_bytes() / GIB / workers)
    return asked or None


def close_in_children(descriptors: Sequence[int]) -> None:
    """Close these files in every process that this one forks."""
    os.register_at_fork(after_in_child=lambda: _close(descriptors))


def _close(descriptors: Sequence[int]) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in descriptors:
        os.dup2(nowhere, descriptor, inheritable=False)  # the number stays taken: a file object has it
    os.close(nowhere)
