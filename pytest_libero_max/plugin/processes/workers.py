"""Workers of xdist, seen from the controller: their deaths, and the retries of their pairs."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.evaluation.processes.crash_log import Death, read_death
from pytest_libero_max.evaluation.processes.deaths import Deaths
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import case_of
from pytest_libero_max.plugin.processes.this_process import CRASH_LOG_INPUT
from pytest_libero_max.plugin.run_stop import RunStop
from pytest_libero_max.plugin.stash_keys import RESULT_ATTRIBUTE

DISTS = ("worksteal", "load")
"""Ways of xdist to hand out tests one by one, in which a test can be given to another worker."""

_INTERRUPTED = "keyboard-interrupt"
"""Error with which xdist reports a worker after Ctrl-C; it also stops the session."""

_PATIENCE_S = 5.0
"""Time for a worker that has closed its connection to exit, s."""


RETRIED = "retried"
"""Outcome of the report of a pair that is played again, or was measured before its process died."""


class Retries(Deaths):
    """A plugin beside the one that starts the processes that play."""

    def pytest_libero_max_pair_stored(self, pair: PairRecord | PairError) -> None:
        self.stored(pair)

    def pytest_report_teststatus(self, report: Any) -> tuple[str, str, str] | None:
        """Show a pair that is played again."""
        if report.outcome != RETRIED:
            return None
        return RETRIED, "r", f"RETRIED ({report.longrepr})"

    def report_death(self, report: Any, case: Case, death: Death, play_again: Callable[[], bool]) -> None:
        """Write into the report of a failure what becomes of the pair of a dead process; see :meth:`lose`."""
        lost = self.lose(case, death, play_again)
        if isinstance(lost, PairError):
            setattr(report, RESULT_ATTRIBUTE, lost.to_dict())
            report.longrepr = f"{lost.kind}: {lost.message}"
        else:
            report.outcome, report.longrepr = RETRIED, lost


class Workers:
    """A plugin beside the controller of a run on xdist."""

    def __init__(
        self, config: pytest.Config, settings: Settings, cases: dict[str, Case], stop: RunStop
    ) -> None:
        self._config = config
        self._cases = cases
        self._folder = tempfile.TemporaryDirectory(prefix="libero-max-")
        self._deaths: dict[Any, Death] = {}
        self._retries = Retries(settings, number_of_workers(config), "workers", stop)
        config.pluginmanager.register(self._retries)

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker the path of its crash log."""
        node.workerinput[CRASH_LOG_INPUT] = str(self._crash_log_of(node))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Read why a worker died, and stop the run where nothing but deaths happens."""
        if not error or error == _INTERRUPTED:
            return
        death = read_death(self._crash_log_of(node), _status(node), f"worker {node.gateway.id}")
        self._deaths[node] = death
        self._retries.died(death)

    @pytest.hookimpl(optionalhook=True)
    def pytest_handlecrashitem(self, crashitem: str, report: Any, sched: Any) -> None:
        """Retry the pair of a worker that died on another worker, or report why it is not measured."""
        name = case_of(crashitem)
        case = None if name is None else self._cases.get(name)
        death = self._deaths.get(report.node)
        if case is None or death is None:
            return

        def play_again() -> bool:
            with suppress(NotImplementedError):  # of a scheduler of another plugin
                sched.mark_test_pending(crashitem)
                return True
            return False

        self._retries.report_death(report, case, death, play_again)

    def pytest_unconfigure(self) -> None:
        """Remove the crash log."""
        self._folder.cleanup()

    def _crash_log_of(self, node: Any) -> Path:
        return Path(self._folder.name, f"{node.gateway.id}.txt")


def number_of_workers(config: pytest.Config) -> int:
    """Return the number of workers of xdist, known once it has read its options; 1 without it."""
    specs: list[str] = config.getoption("tx", None) or [""]
    counts = (spec.partition("*")[0] for spec in specs)
    return sum(int(count) if count.isdecimal() else 1 for count in counts)


def let_workers_restart(config: pytest.Config, settings: Settings, pairs: int) -> None:
    """Let xdist start as many fresh workers as the retries of all pairs can need, unless it is told a number.

    Its own default stops a run of days after four deaths for each worker. What ends a run in which nothing
    but deaths happens is :meth:`Workers.pytest_testnodedown`.
    """
    if config.getoption("maxworkerrestart", None) is None:
        config.option.maxworkerrestart = str((pairs + 4) * (settings.retries + 1))


def _status(node: Any) -> int | None:
    """Return the exit status of a worker's process, negative for a signal; None on another machine."""
    process = getattr(getattr(node.gateway, "_io", None), "popen", None)
    if not isinstance(process, subprocess.Popen) or not node.gateway.spec.popen:
        return None
    with suppress(subprocess.TimeoutExpired):
        return process.wait(_PATIENCE_S)
    return None
