from __future__ import annotations

import time
from typing import Any

import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.transport import Client, Unreachable


class Script:
    """A link that does what it is told: raises an exception, or returns anything else."""

    def __init__(self, *answers: Any) -> None:
        self.answers = list(answers)
        self.opened = 0
        self.is_open = False

    def open(self) -> Any:
        self.opened += 1
        self.is_open = True
        return {"greeting": self.opened}

    def ask(self, request: Any) -> Any:
        assert self.is_open
        answer = self.answers.pop(0)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def close(self) -> None:
        self.is_open = False


class Clock:
    """Time that passes only while somebody waits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        self.pauses: list[float] = []
        monkeypatch.setattr(time, "monotonic", lambda: self.now)

    def sleep(self, seconds: float) -> None:
        self.pauses.append(seconds)
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def client(link: Script, clock: Clock, patience_s: float = 60.0) -> Client:
    return Client("server", link, patience_s, sleep=clock.sleep)


def test_a_lost_connection_is_opened_again_with_growing_pauses(clock: Clock) -> None:
    link = Script(*[Unreachable("gone")] * 7, "answer")
    asked = client(link, clock)
    assert asked.ask("?", str.upper) == "ANSWER"
    assert clock.pauses == [0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 5.0]
    assert link.opened == 8
    assert (asked.interruptions, asked.waited_s) == (1, sum(clock.pauses))


def test_a_server_that_stays_away_is_given_up_when_the_patience_ends(clock: Clock) -> None:
    asked = client(Script(*[Unreachable("gone")] * 99), clock, patience_s=10.0)
    with pytest.raises(ServerError, match=r"^server: gone\..* tried \d+ times? in \d\.\d s"):
        asked.ask("?", str)
    assert clock.now <= 10.0
    # Later queries ask once, until the server is back: then it is waited for again.
    pauses = len(clock.pauses)
    with pytest.raises(ServerError, match="tried 1 time"):
        asked.ask("?", str)
    assert len(clock.pauses) == pauses


def test_a_server_that_comes_back_is_trusted_again(clock: Clock) -> None:
    asked = client(
        Script(*[Unreachable("gone")] * 6, "one", Unreachable("gone"), "two"), clock, patience_s=5.0
    )
    with pytest.raises(ServerError):
        asked.ask("?", str)
    while clock.pauses:
        clock.pauses.pop()
    results = []
    for _ in range(4):
        try:
            results.append(asked.ask("?", str))
        except ServerError:
            results.append("-")
        if "two" in results:
            break
    assert [result for result in results if result != "-"] == ["one", "two"]
    assert clock.pauses == [0.25]


def test_three_useless_answers_are_enough(clock: Clock) -> None:
    link = Script("bad", "bad", "bad", "good")

    def read(reply: str) -> str:
        if reply == "bad":
            raise ServerError("not finite")
        return reply

    asked = client(link, clock)
    with pytest.raises(ServerError, match=r"not finite.*3 times"):
        asked.ask("?", read)
    assert link.answers == ["good"]


def test_the_connection_is_given_up_when_somebody_interrupts(clock: Clock) -> None:
    link = Script(KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        client(link, clock).ask("?", str)
    assert not link.is_open


def test_the_greeting_is_told_at_every_opening(clock: Clock) -> None:
    told: list[Any] = []
    asked = Client("server", Script(Unreachable("gone"), "x"), 60.0, sleep=clock.sleep)
    asked.on_open = told.append
    asked.connect()
    asked.ask("?", str)
    assert told == [{"greeting": 1}, {"greeting": 2}]
