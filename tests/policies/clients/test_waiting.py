"""Waits for servers are noted for the progress of a run, and forgotten once the server answers."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.policies.clients import waiting
from pytest_libero_max.policies.clients.transport import Client, Unreachable

LIMIT_S = 20.0


class Slow:
    """A server that cannot be reached at first, and then takes its time to answer."""

    def __init__(self) -> None:
        self.reachable, self.answers = threading.Event(), threading.Event()

    def open(self) -> None:
        if not self.reachable.is_set():
            raise Unreachable("cannot be reached (refused)")

    def ask(self, request: Any) -> str:
        assert self.answers.wait(LIMIT_S)
        return "answer"

    def close(self) -> None:
        pass


@pytest.fixture
def noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(waiting, "NOTED_AFTER_S", 0.0)
    monkeypatch.setattr(waiting, "_LOOK_S", 0.02)
    monkeypatch.setattr(waiting, "_NOTER", waiting._Noter())
    waiting.note_in(tmp_path)
    yield tmp_path
    waiting.forget_waits(tmp_path)


def _until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT_S
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_wait_is_told_with_its_deadline_until_the_server_answers(noted: Path) -> None:
    server = Slow()
    client = Client("policy server x", server, 300.0, sleep=lambda seconds: time.sleep(0.02), timeout_s=120.0)
    answers: list[str] = []
    asking = threading.Thread(target=lambda: answers.append(client.ask("?", str)), daemon=True)
    asking.start()
    _until(lambda: any("cannot be reached" in line for line in waiting.waiting_lines(noted)))
    (line,) = waiting.waiting_lines(noted)
    assert re.search(r"x, 0 s \(given up after 300 s\): .*refused", line)
    server.reachable.set()
    server.answers.set()
    asking.join(LIMIT_S)
    assert answers == ["answer"]
    _until(lambda: waiting.waiting_lines(noted) == [] and not (noted / waiting.FOLDER).exists())


def test_a_call_that_lasts_is_told_with_its_time_limit(noted: Path) -> None:
    server = Slow()
    server.reachable.set()
    client = Client("policy server x", server, 300.0, timeout_s=120.0)
    asking = threading.Thread(target=lambda: client.ask("?", str), daemon=True)
    asking.start()
    _until(lambda: bool(waiting.waiting_lines(noted)))
    (line,) = waiting.waiting_lines(noted)
    assert line.endswith("0 s (asked again after 120 s)")
    server.answers.set()
    asking.join(LIMIT_S)


def test_notes_of_a_process_that_died_are_not_told(noted: Path) -> None:
    folder = noted / waiting.FOLDER
    folder.mkdir()
    wait = '[{"server": "s", "patience_s": 1, "timeout_s": null, "why": "", "since": 0}]'
    strange = wait.replace('"since": 0', '"since": "noon"')
    for number, text in enumerate((wait, wait, "[{}]", "half", strange, "[" * 5000), start=1):
        (folder / f"a-{number}.json").write_text(text)
    assert len(waiting.noted_waits(noted)) == 2
    (line,) = waiting.waiting_lines(noted)
    assert line.endswith("(2 processes)")
    os.utime(folder / "a-1.json", (1, 1))
    assert len(waiting.noted_waits(noted)) == 1
