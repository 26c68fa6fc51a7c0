from __future__ import annotations

import io

import pytest

from pytest_libero_max.runs.live_text import LiveText, shortened, understands_sequences
from tests.terminal import Terminal


@pytest.fixture(autouse=True)
def columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setenv("LINES", "10")


def _shown(stream: io.StringIO, columns: int = 40) -> list[str]:
    terminal = Terminal(columns)
    terminal.feed(stream.getvalue())
    return terminal.shown()


@pytest.mark.parametrize("before", ["", "PPR", "a line\nPPR", "x" * 39, "x" * 95])
def test_what_others_write_goes_on_where_it_was(before: str) -> None:
    stream = io.StringIO()
    live = LiveText(stream)
    stream.write(before)
    column = len(before.rsplit("\n", 1)[-1])
    live.draw(["one", "two"], column)
    assert _shown(stream)[-2:] == ["one", "two"]
    live.draw(["three"], column)
    assert _shown(stream)[-1] == "three"
    assert "two" not in _shown(stream)
    live.erase()
    stream.write("N\nnext")
    whole = Terminal(40)
    whole.feed(f"{before}N\nnext")
    assert _shown(stream) == whole.shown()


def test_lines_are_cut_to_the_terminal() -> None:
    stream = io.StringIO()
    LiveText(stream).draw(["x" * 100, *map(str, range(20))])
    assert _shown(stream) == ["x" * 36 + "...", *map(str, range(7))]
    assert shortened("short", 5) == "short"


def test_nothing_is_erased_that_was_not_drawn() -> None:
    stream = io.StringIO()
    LiveText(stream).erase()
    assert stream.getvalue() == ""


def test_only_a_terminal_understands(monkeypatch: pytest.MonkeyPatch) -> None:
    class Typewriter(io.StringIO):
        def isatty(self) -> bool:
            return True

    assert not understands_sequences(io.StringIO())
    monkeypatch.setenv("TERM", "xterm")
    assert understands_sequences(Typewriter())
    monkeypatch.setenv("TERM", "dumb")
    assert not understands_sequences(Typewriter())
