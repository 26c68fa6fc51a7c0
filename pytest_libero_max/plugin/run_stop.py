"""Stop of a run: the same for a session that plays itself, for workers of xdist and for actors on Ray.

Each process that plays asks its own :class:`PairGate` before it begins a pair. :meth:`RunStop.stop` in the
process that owns the run closes all of them.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NoReturn

import pytest

from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.plugin.collection import PairItem
from pytest_libero_max.plugin.stash_keys import STOP
from pytest_libero_max.runs.stopped import Stopped

_COMMAND = "libero_max_stop"
"""Command of the controller to a worker of xdist, which ignores commands that it does not know."""

_INTERRUPTED = 2

_GATE = pytest.StashKey["PairGate"]()


class PairGate:
    """A plugin of each process that plays: once closed, it lets no pair begin. Other tests are played."""

    def __init__(self, config: pytest.Config) -> None:
        self.closed = False
        config.stash[_GATE] = self
        for plugin in config.pluginmanager.get_plugins():
            if hasattr(plugin, "handle_command"):  # this is a worker of xdist
                self._listen(plugin)

    def _listen(self, interactor: Any) -> None:
        handle = interactor.handle_command

        def handle_command(command: Any) -> None:
            if isinstance(command, tuple) and command[0] == _COMMAND:
                self.closed = True
            else:
                handle(command)

        interactor.handle_command = handle_command

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
        if not (self.closed and isinstance(item, PairItem)):
            return None
        if nextitem is not None and not isinstance(nextitem, PairItem):
            item.session._setupstate.teardown_exact(nextitem)  # what only the pairs have set up
        return True


def stop_run(item: pytest.Item, reason: str) -> None:
    """Stop the run from the process that plays a pair: here at once, elsewhere by way of the controller.

    Args:
        reason: Cause that would end every later pair in the same way, without a period.
    """
    item.config.stash[_GATE].closed = True
    item.stash[STOP] = reason


class RunStop(Stop):
    """A plugin of the process that owns the run.

    A stopping rule stops the pairs, and the session ends in order. Whatever else stops a run, for example a
    policy that cannot be loaded or ``-x``, stops the session.
    """

    def __init__(self, config: pytest.Config, settings: Settings) -> None:
        super().__init__(settings)
        self.status: int | None = None  # exit status of a session that :meth:`abort` ended
        self._config = config
        self._gate = PairGate(config)
        config.pluginmanager.register(self._gate)
        self._session: pytest.Session | None = None
        self._workers: set[Any] = set()

    @property
    def stopped(self) -> Stopped | None:
        """Reason of the stop, also that of ``-x``; None as long as the run goes on."""
        session = self._session
        if self._stopped is None and session is not None and (session.shouldfail or session.shouldstop):
            self._close(Stopped(str(session.shouldfail or session.shouldstop), self._planned))
        return self._stopped

    def stop(self, reason: str) -> None:
        if self.stopped is not None:
            return
        super().stop(reason)
        distributed: Any = self._config.pluginmanager.get_plugin("dsession")
        if distributed is not None:
            distributed.shouldstop = reason
        elif self._session is not None:
            self._session.shouldfail = reason

    def abort(self, message: str, status: int) -> NoReturn:
        """End the session at once, because no pair could be stored any more."""
        self.status = status
        pytest.exit(message)  # with a status of its own, pytest would leave out the summary

    def _close(self, stopped: Stopped) -> None:
        super()._close(stopped)
        self._gate.closed = True
        for worker in self._workers:
            _tell(worker)

    # What is seen of the session and its workers.

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self, session: pytest.Session) -> None:
        self._session = session

    @pytest.hookimpl(trylast=True)
    def pytest_runtest_logreport(self) -> None:
        _ = self.stopped  # -x may have stopped the session

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodeready(self, node: Any) -> None:
        self._workers.add(node)
        if self._stopped is not None:
            _tell(node)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Stop the other workers where one has stopped, which xdist lets play what they have been handed."""
        self._workers.discard(node)
        output = getattr(node, "workeroutput", None) or {}
        reason = output.get("shouldfail") or output.get("shouldstop")
        if output.get("exitstatus") == _INTERRUPTED:
            reason = "a worker was interrupted"
        if reason and self.stopped is None:
            self._close(Stopped(str(reason), self._planned))


def _tell(worker: Any) -> None:
    with suppress(OSError):  # it has gone meanwhile
        worker.sendcommand(_COMMAND)
