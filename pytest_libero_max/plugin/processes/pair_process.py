"""Process that plays pairs: its time limits, its memory limit, its crash log."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.errors import LimitReached, MemoryLimitError, TimeLimitError
from pytest_libero_max.machine import GIB, limit_private_bytes, memory_bytes, return_large_blocks
from pytest_libero_max.plugin.collection import settings_of
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.processes.crash_log import MEMORY, Activity, CrashLog
from pytest_libero_max.plugin.processes.time_limits import Watchdog
from pytest_libero_max.substrates.registry import SUBSTRATES

CRASH_LOG_INPUT = "libero_max_crash_log"
"""Key in a worker's input of the path of its crash log."""

OUT_OF_MEMORY = 70
"""Exit status of a process that wanted more memory than it may use."""

SHARE = 0.9
"""Share of the machine's memory that its processes may use together by default."""

_PROCESS = pytest.StashKey["PairProcess"]()


class PairProcess:
    """This process, as it plays pairs. Its limits hold from now on, and for the processes that it starts.

    Args:
        settings: The limits.
        workers: Number of processes that share the memory of the machine.
        log: Its crash log; None in the session's own process, whose death ends the session.
        stderr: File descriptor for the tracebacks of the session's own process.
    """

    def __init__(self, settings: Settings, workers: int, log: CrashLog | None, stderr: int = 2) -> None:
        self.phase = "setup"
        return_large_blocks()
        self.watchdog = Watchdog(settings.timeouts, log, stderr)
        self._log = log
        self._memory_gib = memory_gib(settings.memory, workers, SUBSTRATES[settings.substrate].limit_gib)
        if self._memory_gib is not None:
            limit_private_bytes(int(self._memory_gib * GIB))

    @contextmanager
    def pair(self) -> Iterator[None]:
        """Play a pair in the block."""
        with nullcontext() if self._log is None else self._log.capture_stderr():
            try:
                yield
            except Exception as error:
                if self._log is not None and self._is_memory(error):
                    self._log.note(Activity(self.phase, MEMORY, self._memory_text()))
                    os._exit(OUT_OF_MEMORY)  # nobody knows what holds the memory; a fresh process has it free
                raise

    def enter(self, phase: str) -> None:
        """Begin a phase of the pair."""
        self.phase = phase
        self.watchdog.enter(phase)

    def ended_by(self, error: BaseException) -> TimeLimitError | MemoryLimitError | None:
        """Return the limit that ended a pair with this error; this process is then not to be trusted."""
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


def pair_process_of(config: pytest.Config) -> PairProcess:
    """Return this process as it plays pairs; its limits begin at the first call."""
    if _PROCESS not in config.stash:
        settings = settings_of(config)
        worker = getattr(config, "workerinput", None)
        if worker is None:
            config.stash[_PROCESS] = PairProcess(settings, 1, None, config.stash.get(STDERR, 2))
        else:
            path = Path(worker.get(CRASH_LOG_INPUT, ""))
            if not path.parent.is_dir() or not path.name:  # the controller is on another machine
                path = Path(tempfile.mkdtemp(), "crash-log")
            config.stash[_PROCESS] = PairProcess(settings, int(worker["workercount"]), CrashLog(path))
    return config.stash[_PROCESS]


STDERR = pytest.StashKey[int]()
"""On the config: stderr as it was before pytest captures it."""


def keep_from_children(config: pytest.Config) -> None:
    """Let no process that this worker forks hold its connection to the controller open.

    An adapter may fork helpers. The connection of a worker that is killed would stay open as long as one of
    them lives, and the controller would wait for the worker instead of replacing it.
    """
    plugins = config.pluginmanager.get_plugins()
    close_in_children([number for plugin in plugins for number in _descriptors(plugin)])


def close_in_children(descriptors: Sequence[int]) -> None:
    """Close these files in every process that this one forks."""
    os.register_at_fork(after_in_child=lambda: _close(descriptors))


def _descriptors(plugin: Any) -> list[int]:
    """File descriptors of the connection, where this is the plugin of xdist that has it."""
    gateway = getattr(getattr(plugin, "channel", None), "gateway", None)
    files = (getattr(getattr(gateway, "_io", None), name, None) for name in ("infile", "outfile"))
    return [file.fileno() for file in files if file is not None]


def _close(descriptors: Sequence[int]) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in descriptors:
        os.dup2(nowhere, descriptor, inheritable=False)  # the number stays taken: a file object has it
    os.close(nowhere)
