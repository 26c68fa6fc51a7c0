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
from pathlib import Path
from typing import Any, TextIO

import pytest

from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.collection import case_of
from pytest_libero_max.policies.clients.waiting import forget_waits, waiting_lines
from pytest_libero_max.runs.live_text import LiveText, understands_sequences
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.progress import Pace, progress_text
from pytest_libero_max.runs.status import ProgressNotes
from pytest_libero_max.runs.store import PairStore

_WAIT_LOOK_S = 1.0
_WAIT_LINE_S = 60.0
"""Time between two lines on waits, where these scroll."""

_Wrapper = Generator[None, Any, Any]


class RunProgress:
    """Registered beside the run's controller, which calls :meth:`begin`."""

    def __init__(self, config: pytest.Config, form: str) -> None:
        self._config, self._form = config, form
        self._notes = ProgressNotes()
        self._folder = Path()
        self._live: LiveText | None = None
        self._stream: TextIO | None = None
        self._pace: Pace | None = None
        self._reporter: Any = None
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._idle = False  # pytest waits, and writes nothing
        self._waited = False  # a wait is shown

    def begin(
        self,
        store: PairStore,
        planned: Sequence[PlannedPair],
        settled: Sequence[PairRecord | PairError],
    ) -> None:
        """Begin to show and note a run."""
        self._notes.begin(store, planned, settled)
        self._folder = store.path.parent
        self._reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if self._reporter is not None:
            self._choose_form(self._reporter)
        forget_waits(self._folder)
        if self._live is not None or self._pace is not None:
            threading.Thread(target=self._tell_waits, name="libero-max-progress", daemon=True).start()

    def _tell_waits(self) -> None:
        """Show waits for servers while pytest itself waits."""
        last = -math.inf
        while not self._over.wait(_WAIT_LOOK_S):
            with self._lock:
                if not self._idle:
                    continue
                if self._live is not None:
                    if self._waited or waiting_lines(self._folder):
                        self._draw_now()
                elif time.monotonic() - last >= _WAIT_LINE_S and (lines := waiting_lines(self._folder)):
                    last = time.monotonic()
                    self._write_beside(lines)

    def _write_beside(self, lines: Sequence[str]) -> None:
        """Write lines where pytest's own stream may be captured."""
        if self._stream is not None:
            with suppress(OSError, ValueError):
                self._stream.write("".join(f"\nlibero-max: {line}" for line in lines) + "\n")
                self._stream.flush()

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
        if name is not None:
            self._notes.play(name)
        self._draw()
        return result

    def pytest_libero_max_pair_stored(self, pair: PairRecord | PairError) -> None:
        self._notes.stored(pair)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> _Wrapper:
        self._erase()
        result = yield
        if report.when not in ("setup", "call"):  # it has ended, or its worker has died
            self._notes.playing.pop(case_of(report.nodeid) or "", None)
        if self._pace is not None and self._notes.goes_on and self._pace.due(time.monotonic()):
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
            if self._notes.counts.planned:
                forget_waits(self._folder)
            if self._stream is not None:
                with suppress(OSError):
                    self._stream.close()

    @pytest.hookimpl(tryfirst=True)
    def pytest_exception_interact(self) -> None:
        self._erase()  # a debugger may begin

    # What is shown.

    def _text(self) -> str:
        return progress_text(self._notes.progress, time.time())

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

    def _draw_now(self) -> None:
        if self._live is None or not self._notes.goes_on:
            return
        playing = sorted(self._notes.playing, key=self._notes.playing.__getitem__)
        line = f"libero-max: {self._text()}" + (f", playing {', '.join(playing)}" if playing else "")
        waits = waiting_lines(self._folder)
        self._waited = bool(waits)
        with suppress(OSError, ValueError):  # the terminal may be gone
            self._reporter.flush()
            self._live.draw([line, *waits], self._config.get_terminal_writer().width_of_current_line)

    def _erase(self) -> None:
        with self._lock:
            self._idle = False
            if self._live is not None:
                with suppress(OSError, ValueError):
                    self._live.erase()


def _duplicate(stream: TextIO) -> TextIO | None:
    """Return a duplicate of the stream that pytest's capturing leaves alone."""
    try:
        return os.fdopen(os.dup(stream.fileno()), "w", encoding="utf-8", errors="replace")
    except (AttributeError, OSError, UnsupportedOperation, ValueError):
        return None
