"""Servers with one mistake each: its rule finds it, and no other ``must``; a sound one keeps all."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome
from pytest_libero_max.conformance.server import clients
from pytest_libero_max.conformance.server.subject import open_at
from pytest_libero_max.policies.clients import transport
from pytest_libero_max.policies.clients.codecs import OPENPI, pack, unpack
from tests.policies.clients.fakes import QUIET

RULES = rules_for("server")

PROFILE = """
extends = "pi05_libero"
[policy]
repeatable = true
"""


class Server:
    """A sound server of the openpi protocol: a function of the request, with an error in words for others."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.open = True

    def answer(self, request: Any) -> Any:
        state = np.asarray(request["observation/state"], dtype=float)
        image = int(np.asarray(request["observation/image"], dtype=int).sum())
        actions = np.random.default_rng([abs(image), int(1e6 * abs(state.sum()))]).uniform(-0.5, 0.5, (10, 7))
        actions[:, 6] = -1.0
        return {"actions": actions}

    def reply(self, message: bytes) -> bytes | str | None:
        try:
            return pack(self.answer(unpack(message, OPENPI)), OPENPI)
        except Exception as error:
            return f"Traceback: {error!r}"

    def talk(self, connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError):
            connection.send(pack({}, OPENPI))
            for message in connection:
                reply = self.reply(message) if isinstance(message, bytes) else None
                if reply is None:
                    connection.close()
                    return
                connection.send(reply)

    @contextmanager
    def serving(self) -> Iterator[int]:
        def talk(connection: ServerConnection) -> None:
            self.talk(connection)

        with serve(talk, "127.0.0.1", 0, compression=None, max_size=None, logger=QUIET) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            try:
                yield server.socket.getsockname()[1]
            finally:
                server.shutdown()
                thread.join(5)


class Failing(Server):
    def answer(self, request: Any) -> Any:
        raise RuntimeError("out of memory")


class NotFinite(Server):
    def answer(self, request: Any) -> Any:
        return {"actions": np.full((10, 7), np.nan)}


class Interrupted(Server):
    """Loses each connection at its third query."""

    def talk(self, connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError):
            connection.send(pack({}, OPENPI))
            for _ in range(2):
                connection.send(self.reply(connection.recv(decode=False)) or "")
            connection.recv()


class Longer(Server):
    def answer(self, request: Any) -> Any:
        return {"actions": np.repeat(super().answer(request)["actions"], 2, axis=0)[:12]}


class OneAtATime(Server):
    def talk(self, connection: ServerConnection) -> None:
        with self.lock:
            super().talk(connection)


class Shared(Server):
    """Answers with the mean of the last two requests of whatever client, each connection beginning anew."""

    last: Any = None

    def talk(self, connection: ServerConnection) -> None:
        with self.lock:
            self.last = None
        super().talk(connection)

    def answer(self, request: Any) -> Any:
        actions = super().answer(request)["actions"]
        self.last, mean = actions, actions if self.last is None else (actions + self.last) / 2
        return {"actions": mean}


class Counting(Server):
    """Moves less with each connection that it has had, all of them at once."""

    connections = 0

    def talk(self, connection: ServerConnection) -> None:
        with self.lock:
            self.connections += 1
        super().talk(connection)

    def answer(self, request: Any) -> Any:
        return {"actions": super().answer(request)["actions"] / (1 + self.connections // 2)}


class DownWithItsClient(Server):
    """Ends when a client has left while its answer was made."""

    def reply(self, message: bytes) -> bytes | str | None:
        time.sleep(0.1)
        return super().reply(message) if self.open else None

    def talk(self, connection: ServerConnection) -> None:
        try:
            connection.send(pack({}, OPENPI))
            for message in connection:
                reply = self.reply(bytes(message)) if isinstance(message, bytes) else None
                if reply is None:
                    return
                connection.send(reply)
        except ConnectionClosed:
            self.open = False


class Impatient(Server):
    """Closes a connection that is silent for half a second."""

    def talk(self, connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError, TimeoutError):
            connection.send(pack({}, OPENPI))
            while True:
                connection.send(self.reply(connection.recv(timeout=0.5, decode=False)) or "")


class Mute(Server):
    """Hangs up where it should say what is wrong."""

    def reply(self, message: bytes) -> bytes | str | None:
        reply = super().reply(message)
        return None if isinstance(reply, str) else reply


class Obliging(Server):
    """Takes zeros for whatever is missing."""

    def answer(self, request: Any) -> Any:
        blank = {"observation/state": np.zeros(8), "observation/image": np.zeros((8, 8, 3))}
        return super().answer({**blank, **request})


class Broken(Server):
    """Answers nothing any more after a request that it did not understand."""

    def reply(self, message: bytes) -> bytes | str | None:
        reply = super().reply(message) if self.open else "Traceback: the model is gone"
        self.open &= not isinstance(reply, str)
        return reply


GALLERY: list[tuple[type[Server], str, str]] = [
    (Failing, "contract/answers", "out of memory"),
    (NotFinite, "contract/answers", "finite"),
    (Interrupted, "contract/answers", "met 1 interruption"),
    (Longer, "contract/chunk", "a reply has 12 actions"),
    (OneAtATime, "clients/second", "no answer within"),
    (Shared, "clients/company", "other answers than each alone"),
    (Counting, "clients/reconnects", "gets other answers"),
    (DownWithItsClient, "clients/leaves", "after a client left in the middle of a query"),
    (Impatient, "clients/idle", "lost after"),
    (Mute, "errors/words", "a request without any input"),
    (Obliging, "errors/words", "was answered with actions"),
    (Broken, "errors/survives", "the model is gone"),
]
MAY_ALSO_BREAK = {
    Counting: ("clients/company",),
    DownWithItsClient: ("clients/idle", "errors/words", "errors/survives"),  # it stays down
}


@pytest.fixture
def examine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Server], dict[str, Outcome]]:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    monkeypatch.setattr(clients, "PAUSE_S", 1.0)
    monkeypatch.setattr(clients, "TOGETHER_S", 2.0)
    profile = tmp_path / "repeating.toml"
    profile.write_text(PROFILE)

    def outcomes(server: Server) -> dict[str, Outcome]:
        serving: AbstractContextManager[int] = server.serving()
        with serving as port:
            address = f"openpi://127.0.0.1:{port}?patience=0.3&timeout=5"
            subject = open_at(address, str(profile), "tiny")
            found = Examination(lambda: subject, RULES).outcomes()
        return {outcome.rule.id.removeprefix("server/"): outcome for outcome in found}

    return outcomes


def broken(outcomes: dict[str, Outcome]) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == "broken"]


def test_a_sound_server_keeps_every_rule(examine: Callable[[Server], dict[str, Outcome]]) -> None:
    outcomes = examine(Server())
    assert {outcome.state for outcome in outcomes.values()} == {"kept"}, broken(outcomes)


@pytest.mark.parametrize(("server", "name", "observed"), GALLERY, ids=[each[0].__name__ for each in GALLERY])
def test_a_mistake_breaks_its_rule_and_no_other(
    server: type[Server], name: str, observed: str, examine: Callable[[Server], dict[str, Outcome]]
) -> None:
    outcomes = examine(server())
    assert observed in " ".join(finding.observed for finding in outcomes[name].findings)
    assert all(finding.expected and finding.cure for finding in outcomes[name].broken)
    assert [each for each in broken(outcomes) if each not in MAY_ALSO_BREAK.get(server, ())] == [name]


def test_a_server_that_is_not_there_breaks_the_first_rule(tmp_path: Path) -> None:
    profile = tmp_path / "repeating.toml"
    profile.write_text(PROFILE)
    with Server().serving() as port:
        pass

    def opens() -> object:
        return open_at(f"openpi://127.0.0.1:{port}?patience=0.1", str(profile), "tiny")

    outcomes = Examination(opens, RULES).outcomes()
    assert [outcome.rule.id for outcome in outcomes if outcome.state == "broken"] == [clients.CONNECTS]
