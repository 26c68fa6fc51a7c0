"""Progress of a run in the terminal, and as a note for whoever watches its folder.

On a terminal it is one line below pytest's own output, drawn before pytest waits and erased before it writes,
so that nothing of it stays. Elsewhere, for example in the log of a CI service, there is a line a minute, and
later fewer.
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import suppress
from io import UnsupportedOperation
from typing import Any, TextIO

import pytest

from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import case_of
from pytest_libero_max.policies.clients.waiting import forget_waits, waiting_lines
from pytest_libero_max.runs.live_text import LiveText, understands_sequences
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.progress import Pace, PairCounts, Progress, progress_text
from pytest_libero_max.runs.status import note_of
from pytest_libero_max.runs.store import PairStore

_WAIT_LOOK_S = 1.0
_WAIT_LINE_S = 60.0
"""Time between two lines on waits, where these scroll."""

_COMPOSED_S = 0.1
"""Time for which a terminal shows the same line again, s: to compose it counts all pairs of the run."""

_Wrapper = Generator[None, Any, Any]


class RunProgress:
    """Registered beside the run's controller, which calls :meth:`begin`.

    Args:
        form: ``auto``, ``live``, ``lines`` or ``none``.
    """

    def __init__(self, config: pytest.Config, form: str) -> None:
        self._config, self._form = config, form
        self._store: PairStore | None = None
        self._counts = PairCounts()
        self._before = 0
        self._playing: dict[str, float] = {}  # since when, seconds since the epoch
        self._workers: dict[str, str] = {}
        self._began = 0.0
        self._live: LiveText | None = None
        self._stream: TextIO | None = None
        self._pace: Pace | None = None
        self._reporter: Any = None
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._idle = False  # pytest waits, and writes nothing
        self._waited = False  # a wait is shown
        self._lines: list[str] = []  # below pytest's output
        self._composed_at = -math.inf
        self._stale = False  # something has happened since they were composed

    def begin(
        self,
        store: PairStore,
        planned: Sequence[PlannedPair],
        settled: Sequence[PairRecord | PairError],
    ) -> None:
        """Begin to show and note a run.

        Args:
            store: Takes the notes.
            planned: The pairs of the run.
            settled: Pairs of a resumed run that are not played again. One with a fault is.
        """
        self._store, self._counts.planned = store, planned
        self._before = sum(isinstance(pair, PairRecord) for pair in settled)
        for pair in settled:
            self._counts.add(pair)
        self._began = time.time()
        self._note_workers()
        self._reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if self._reporter is not None:
            self._choose_form(self._reporter)
        self._note()
        forget_waits(store.path.parent)
        if self._live is not None or self._pace is not None:
            threading.Thread(target=self._tell_waits, name="libero-max-progress", daemon=True).start()

    def _tell_waits(self) -> None:
        """Show waits for servers, and what happened last, while pytest itself waits."""
        last = -math.inf
        while not self._over.wait(_WAIT_LOOK_S):
            with self._lock:
                if not self._idle or self._store is None:
                    continue
                if self._live is not None:
                    if self._stale or self._waited or self._waits():
                        self._composed_at = -math.inf
                        self._draw_now()
                elif time.monotonic() - last >= _WAIT_LINE_S and (lines := self._waits()):
                    last = time.monotonic()
                    self._write_beside(lines)

    def _write_beside(self, lines: Sequence[str]) -> None:
        """Write lines where pytest's own stream may be captured."""
        if self._stream is not None:
            with suppress(OSError, ValueError):
                self._stream.write("".join(f"\nlibero-max: {line}" for line in lines) + "\n")
                self._stream.flush()

    def _note_workers(self) -> None:
        """Note which worker begins a test, which xdist does not hand on to its hooks."""
        session: Any = self._config.pluginmanager.get_plugin("dsession")
        if session is None:
            return
        hand_on = session.worker_logstart

        def worker_logstart(node: Any, nodeid: str, location: Any) -> None:
            self._workers[case_of(nodeid) or ""] = node.gateway.id
            hand_on(node, nodeid, location)

        session.worker_logstart = worker_logstart

    def began(self, item_id: str, worker: str) -> None:
        """Note that a worker that is not one of xdist's begins a pair."""
        self._workers[item_id] = worker

    def _choose_form(self, reporter: Any) -> None:
        form = self._form
        if form == "auto":
            terminal = understands_sequences(sys.stdout) and not self._prints_in_between()
            form = "live" if terminal else "lines"
            if reporter.verbosity < (-1 if terminal else 0):
                form = "none"
        if form in ("live", "lines"):
            self._stream = _duplicate(sys.stdout)
        if form == "live" and self._stream is not None:
            self._live = LiveText(self._stream)
        elif form in ("live", "lines"):
            self._pace = Pace(time.monotonic())

    def _prints_in_between(self) -> bool:
        """Return True if tests write to the terminal while they run, where no line could be erased before."""
        config = self._config
        if config.getoption("capture", "no") == "no" or config.getoption("log_cli_level", None) is not None:
            return True
        return config.pluginmanager.has_plugin("logging-plugin") and bool(config.getini("log_cli"))

    # What happens.

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logstart(self, nodeid: str) -> _Wrapper:
        self._erase()
        result = yield
        name = case_of(nodeid)
        if name is not None and self._store is not None:
            self._playing[name] = time.time()
            self._note()
        self._draw()
        return result

    def pytest_libero_max_pair_stored(self, pair: PairRecord | PairError) -> None:
        self._counts.add(pair)
        self._forget(pair.item_id)
        self._note()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> _Wrapper:
        self._erase()
        result = yield
        if report.when not in ("setup", "call"):  # it has ended, or its worker has died
            self._forget(case_of(report.nodeid) or "")
        if self._pace is not None and self._playing_pairs() and self._pace.due(time.monotonic()):
            self._write_line(f"libero-max: {self._text()}")
        self._draw()
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logfinish(self) -> _Wrapper:
        self._erase()
        result = yield
        self._draw()
        return result

    @pytest.hookimpl(wrapper=True, optionalhook=True)
    def pytest_testnodedown(self) -> _Wrapper:
        self._erase()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtestloop(self) -> _Wrapper:
        try:
            return (yield)
        finally:
            self._over.set()
            self._erase()
            self._live = self._pace = None
            if self._store is not None:
                forget_waits(self._store.path.parent)
            if self._stream is not None:
                with suppress(OSError):
                    self._stream.close()

    @pytest.hookimpl(tryfirst=True)
    def pytest_exception_interact(self) -> None:
        self._erase()  # a debugger may begin

    def _forget(self, item_id: str) -> None:
        self._playing.pop(item_id, None)
        self._workers.pop(item_id, None)

    def _playing_pairs(self) -> bool:
        return self._store is not None and len(self._counts.letters) < self._counts.to_play

    # What is shown.

    def _progress(self) -> Progress:
        now = time.time()
        playing = {name: now - begun for name, begun in self._playing.items()}
        return Progress(self._counts.to_play, self._counts, self._before, now - self._began, playing)

    def _text(self) -> str:
        return progress_text(self._progress(), time.time())

    def _write_line(self, line: str) -> None:
        self._reporter.ensure_newline()
        if self._config.get_terminal_writer().width_of_current_line:  # letters, of which it does not know
            self._reporter.line("")
        self._reporter.line(line)
        self._reporter.flush()

    def _draw(self) -> None:
        """Show the line, and what is waited for; pytest writes nothing until the next :meth:`_erase`."""
        with self._lock:
            self._idle = True
            self._draw_now()

    def _waits(self) -> list[str]:
        return [] if self._store is None else waiting_lines(self._store.path.parent)

    def _draw_now(self) -> None:
        if self._live is None or self._store is None or not self._playing_pairs():
            return
        self._stale = time.monotonic() - self._composed_at < _COMPOSED_S
        if not self._stale:
            self._compose()
        with suppress(OSError, ValueError):  # the terminal may be gone
            self._reporter.flush()
            self._live.draw(self._lines, self._config.get_terminal_writer().width_of_current_line)

    def _compose(self) -> None:
        self._composed_at = time.monotonic()
        playing = sorted(self._playing, key=lambda name: self._playing[name])
        line = f"libero-max: {self._text()}" + (f", playing {', '.join(playing)}" if playing else "")
        waits = self._waits()
        self._waited = bool(waits)
        self._lines = [line, *waits]

    def _erase(self) -> None:
        with self._lock:
            self._idle = False
            if self._live is not None:
                with suppress(OSError, ValueError):
                    self._live.erase()

    def _note(self) -> None:
        if self._store is not None:
            self._store.note(note_of(self._began, time.time(), self._before, self._playing, self._workers))


def _duplicate(stream: TextIO) -> TextIO | None:
    """Return a duplicate of the stream that pytest's capturing leaves alone."""
    try:
        return os.fdopen(os.dup(stream.fileno()), "w", encoding="utf-8", errors="replace")
    except (AttributeError, OSError, UnsupportedOperation, ValueError):
        return None
