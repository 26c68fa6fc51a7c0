"""The process of a pytest session or of one of its workers, as it plays pairs."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.evaluation.processes.crash_log import CrashLog
from pytest_libero_max.evaluation.processes.pair_process import PairProcess, close_in_children
from pytest_libero_max.evaluation.settings import Settings

CRASH_LOG_INPUT = "libero_max_crash_log"
"""Key in a worker's input of the path of its crash log."""

_PROCESS = pytest.StashKey[PairProcess]()


def pair_process_of(config: pytest.Config, settings: Settings) -> PairProcess:
    """Return this process as it plays pairs; its limits begin at the first call."""
    if _PROCESS not in config.stash:
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


def _descriptors(plugin: Any) -> list[int]:
    """File descriptors of the connection, where this is the plugin of xdist that has it."""
    gateway = getattr(getattr(plugin, "channel", None), "gateway", None)
    files = (getattr(getattr(gateway, "_io", None), name, None) for name in ("infile", "outfile"))
    return [file.fileno() for file in files if file is not None]
