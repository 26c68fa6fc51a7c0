"""Progress of a run in the terminal, and as a note for whoever watches its folder.

On a terminal it is one line below pytest's own output, drawn before pytest waits and erased before it writes,
so that nothing of it stays. Elsewhere, for example in the log of a CI service, there is a line a minute, and
later fewer.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import suppress
from io import UnsupportedOperation
from typing import Any, TextIO

import pytest

from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import case_of
from pytest_libero_max.runs.live_text import LiveText, understands_sequences
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.progress import Pace, PairCounts, Progress, progress_text
from pytest_libero_max.runs.status import note_of
from pytest_libero_max.runs.store import PairStore

_Wrapper = Generator[None, Any, Any]


class RunProgress:
    """Registered beside the run's controller, which calls :meth:`begin`.

    Args:
        config: pytest's config.
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

    def begin(self, store: PairStore, planned: Sequence[PlannedPair], measured: Sequence[PairRecord]) -> None:
        """Begin to show and note a run.

        Args:
            store: Takes the notes.
            planned: The pairs of the run.
            measured: Records that a resumed run holds. A pair with an error is played again.
        """
        self._store, self._counts.planned, self._before = store, planned, len(measured)
        for record in measured:
            self._counts.add(record)
        self._began = time.time()
        self._note_workers()
        self._reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if self._reporter is not None:
            self._choose_form(self._reporter)
        self._note()

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
        if form == "live" and (stream := _duplicate(sys.stdout)) is not None:
            self._stream, self._live = stream, LiveText(stream)
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
        self._playing.pop(pair.item_id, None)
        self._note()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> _Wrapper:
        self._erase()
        result = yield
        if report.when not in ("setup", "call"):  # it has ended, or its worker has died
            self._playing.pop(case_of(report.nodeid) or "", None)
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
            self._erase()
            self._live = self._pace = None
            if self._stream is not None:
                with suppress(OSError):
                    self._stream.close()

    @pytest.hookimpl(tryfirst=True)
    def pytest_exception_interact(self) -> None:
        self._erase()  # a debugger may begin

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
        if self._live is None or not self._playing_pairs():
            return
        playing = sorted(self._playing, key=lambda name: self._playing[name])
        line = f"libero-max: {self._text()}" + (f", playing {', '.join(playing)}" if playing else "")
        with suppress(OSError, ValueError):  # the terminal may be gone
            self._reporter.flush()
            self._live.draw([line], self._config.get_terminal_writer().width_of_current_line)

    def _erase(self) -> None:
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
