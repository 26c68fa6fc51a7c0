from __future__ import annotations

import io
import sys
import time

import pytest

from pytest_libero_max.cli.work import Work
from tests.terminal import Terminal


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_the_last_line_and_keeps_what_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal()
    with Work() as work:
        work.show("1 of 3")
        work.say("written: one")
        work.show("2 of 3")
        terminal.feed(screen.getvalue())
        assert terminal.shown() == ["written: one", "2 of 3"]
        work.show("3 of 3", last=True)
        work.show("1 of 2")
    again = Terminal()
    again.feed(screen.getvalue())
    assert again.shown() == ["written: one", "3 of 3", ""]


def test_elsewhere_there_are_few_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    with Work() as work:
        for second in range(0, 130, 10):
            now[0] = second
            work.show(f"{second} s{work.left(second, 200)}")
        work.show("done", last=True)
    assert capsys.readouterr().out.splitlines() == ["60 s, 2 min left", "120 s, 80 s left", "done"]


def test_no_time_is_left_to_say_before_the_beginning_and_after_the_end() -> None:
    work = Work()
    assert work.left(0, 3) == work.left(3, 3) == ""
