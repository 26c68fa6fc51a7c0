"""Servers with one mistake each: its rule finds it, and no other ``must``; a sound one keeps all."""

from __future__ import annotations

import asyncio
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from websockets.asyncio.server import serve as serve_in_loop
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from pytest_libero_max.conformance.policy.subject import Shown, first_scene
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome, Rule
from pytest_libero_max.conformance.server import clients, contract
from pytest_libero_max.conformance.server import subject as server_subject
from pytest_libero_max.conformance.server.subject import open_at
from pytest_libero_max.policies.clients import recognition, transport
from pytest_libero_max.policies.clients.codecs import OPENPI, VLA_EVAL, pack, unpack
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.policies.server.batching import Batching
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from tests.policies.clients.each_protocol import CERTIFICATE, EACH, accepting, forward, forwarded
from tests.policies.clients.fakes import QUIET
from tests.policies.server.policies import Batched as BatchedPolicy

RULES = rules_for("server")

PROFILE = """
extends = "pi05_libero"
[policy]
repeatable = true
"""


class Server:
    """A sound server of the openpi protocol: a function of the request, with an error in words for others."""

    most_bytes: int | None = None
    greeting: Mapping[str, Any] = MappingProxyType({})

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.open = True

    def greet(self, connection: ServerConnection) -> None:
        connection.send(pack(dict(self.greeting), OPENPI))

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
            self.greet(connection)
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

        with serve(talk, "127.0.0.1", 0, compression=None, max_size=self.most_bytes, logger=QUIET) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            try:
                yield server.socket.getsockname()[1]
            finally:
                server.shutdown()
                thread.join(5)


def answering(name: str, change: Callable[[Any], Any]) -> type[Server]:
    """Return a server whose actions are changed."""
    return type(
        name,
        (Server,),
        {"answer": lambda self, request: {"actions": change(Server.answer(self, request)["actions"])}},
    )


NotFinite = answering("NotFinite", lambda actions: actions * np.nan)
Longer = answering("Longer", lambda actions: np.repeat(actions, 2, axis=0)[:12])
Coarse = answering("Coarse", lambda actions: actions.astype(np.float16))


def declaring(name: str, **parts: Mapping[str, Any]) -> type[Server]:
    """Return a server that says in its greeting what its actions are."""
    return type(name, (Server,), {"greeting": MappingProxyType({"action_spec": parts})})


Wider = declaring("Wider", arm={"dims": 6}, hand={"dims": 2})  # eight components, one of them LIBERO's none
Beyond = declaring("Beyond", arm={"dims": 6, "range": [-0.1, 0.1]}, g={"dims": 1})

Limited = type("Limited", (Server,), {"most_bytes": 2**20})  # as websockets does by default


class Failing(Server):
    def answer(self, request: Any) -> Any:
        raise RuntimeError("out of memory")


class Interrupted(Server):
    """Loses each connection at its third query."""

    def talk(self, connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError):
            self.greet(connection)
            for _ in range(2):
                connection.send(self.reply(connection.recv(decode=False)) or "")
            connection.recv()


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
    """Moves less with each connection that it has had."""

    connections = 0

    def talk(self, connection: ServerConnection) -> None:
        with self.lock:
            self.connections += 1
        super().talk(connection)

    def answer(self, request: Any) -> Any:
        return {"actions": super().answer(request)["actions"] / (1 + self.connections)}


class DownWithItsClient(Server):
    """Ends when a client has left while its answer was made."""

    def reply(self, message: bytes) -> bytes | str | None:
        time.sleep(0.1)
        return super().reply(message) if self.open else None

    def talk(self, connection: ServerConnection) -> None:
        try:
            self.greet(connection)
            for message in connection:
                reply = self.reply(bytes(message)) if isinstance(message, bytes) else None
                if reply is None:
                    return
                connection.send(reply)
        except ConnectionClosed:
            self.open = False


class Impatient(Server):
    """Closes a connection that is silent for 0.3 s."""

    def talk(self, connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError, TimeoutError):
            self.greet(connection)
            while True:
                connection.send(self.reply(connection.recv(timeout=0.3, decode=False)) or "")


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


class Slow(Server):
    """Sound, and slow enough for a ping within a query."""

    def answer(self, request: Any) -> Any:
        time.sleep(0.2)
        return super().answer(request)


class Changing(Server):
    """Greets each client with its number."""

    connections = 0

    def greet(self, connection: ServerConnection) -> None:
        self.connections += 1
        connection.send(pack({"model": "m", "session": self.connections}, OPENPI))


class Foreign(Server):
    """Writes arrays with keys that are texts, as vla-eval does and openpi's clients do not read."""

    def reply(self, message: bytes) -> bytes | str | None:
        reply = super().reply(message)
        return reply if isinstance(reply, str | None) else pack(unpack(reply, OPENPI), VLA_EVAL)


class Drawing(Server):
    """Draws a little noise from a generator that goes on from request to request."""

    def __init__(self) -> None:
        super().__init__()
        self.generator = np.random.default_rng(0)

    def answer(self, request: Any) -> Any:
        actions = super().answer(request)["actions"]
        actions[:, :6] += self.generator.normal(0, 0.01, 6)
        return {"actions": actions}


class OneSize(Server):
    """Loses the connection where images are too small for its patches."""

    def reply(self, message: bytes) -> bytes | str | None:
        image = unpack(message, OPENPI).get("observation/image")
        return None if image is not None and len(image) < 32 else super().reply(message)


class Batched(Server):
    """Computes together what its clients ask, for which it waits a little."""

    def __init__(self) -> None:
        super().__init__()
        self.batch: list[Any] = []
        self.clients = 0
        self.arrived = threading.Condition(self.lock)

    def talk(self, connection: ServerConnection) -> None:
        with self.lock:
            self.clients += 1
        try:
            super().talk(connection)
        finally:
            with self.lock:
                self.clients -= 1

    def batched(self, item: Any) -> tuple[list[Any], int]:
        """Return the batch of an item once it is complete, and the place of the item."""
        with self.arrived:
            batch, place = self.batch, len(self.batch)
            batch.append(item)
            self.arrived.notify_all()
            self.arrived.wait_for(lambda: len(batch) >= self.clients, 0.2)
            self.batch = [] if self.batch is batch else self.batch
        return batch, place

    def answer(self, request: Any) -> Any:
        return {"actions": self.of_batch(*self.batched(super().answer(request)["actions"]))}

    def of_batch(self, batch: list[Any], place: int) -> Any:
        return batch[place]


class MixedUp(Batched):
    """Gives each query of a batch the answer of its neighbour."""

    def of_batch(self, batch: list[Any], place: int) -> Any:
        return batch[place - 1]


class AllFail(Batched):
    """Answers a batch with an error where one of its requests lacks its inputs."""

    def answer(self, request: Any) -> Any:
        batch, _ = self.batched("observation/state" in request)
        if not all(batch):
            raise RuntimeError("a batch without inputs")
        return Server.answer(self, request)


class Rounding(Batched):
    """Answers in a batch differ in their last digits."""

    def of_batch(self, batch: list[Any], place: int) -> Any:
        return batch[place] + (1e-7 if len(batch) > 1 else 0.0)


class Deaf(Server):
    """Computes in its event loop, long where a request is repeated, and answers no ping meanwhile."""

    @contextmanager
    def serving(self) -> Iterator[int]:
        ports: queue.Queue[int] = queue.Queue()
        loop = asyncio.new_event_loop()
        over = asyncio.Event()

        async def talk(connection: Any) -> None:
            with suppress(ConnectionClosed):
                await connection.send(pack({}, OPENPI))
                last = None
                async for message in connection:
                    time.sleep(0.2 if message == last else 0)
                    last = message
                    await connection.send(self.reply(message))

        async def run() -> None:
            async with serve_in_loop(
                talk, "127.0.0.1", 0, compression=None, max_size=None, logger=QUIET
            ) as server:
                ports.put(next(iter(server.sockets)).getsockname()[1])
                await over.wait()

        thread = threading.Thread(target=lambda: loop.run_until_complete(run()), daemon=True)
        thread.start()
        try:
            yield ports.get(timeout=10)
        finally:
            loop.call_soon_threadsafe(over.set)
            thread.join(5)
            loop.close()


class Fragile(Server):
    """Ends when something connects that does not speak its protocol."""

    @contextmanager
    def serving(self) -> Iterator[int]:
        with super().serving() as port:

            def talk(connection: socket.socket) -> None:
                self.open &= connection.recv(1, socket.MSG_PEEK) == b"G"
                if self.open:
                    forward(connection, port)

            with accepting(talk) as fragile:
                yield fragile


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
    (Changing, "contract/greeting", "session"),
    (Wider, "contract/action-spec", "7 components"),
    (Beyond, "contract/action-spec", "arm is"),
    (Coarse, "contract/precision", "float16"),
    (Foreign, "contract/encoding", "keys '__ndarray__', 'data'"),
    (Drawing, "contract/seed", "two different answers"),
    (Limited, "requests/large", "images of 1024 pixels"),
    (OneSize, "requests/small", "images of 16 pixels"),
    (MixedUp, "clients/at-once", "at the same moment"),
    (AllFail, "errors/neighbours", "3 of 3 clients"),
    (Rounding, "clients/rounding", "up to 1e-07"),
    (Deaf, "clients/pings", "were not answered before"),
    (Fragile, "clients/stranger", "bytes of no protocol"),
]
MAY_ALSO_BREAK: dict[type[Server], tuple[str, ...]] = {
    Counting: ("clients/company",),
}


OWN = [
    ("openpi", "served", "", 1),
    ("openpi", "served", "", 4),
    ("vla-eval", "vla_eval_pi05", "/vla-eval", 4),
]
"""Protocol, profile, path and largest batch of the server of this package."""

SCENES: dict[Any, Shown] = {}


@pytest.fixture(autouse=True)
def _scenes_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Show the same observations to all servers with the same images: they take longer than the rules."""

    def first_scene_once(policy: Policy, substrate: str) -> Shown:
        images = (policy.spec.cameras, policy.spec.image_size)
        if images not in SCENES:
            SCENES[images] = first_scene(policy, substrate)
        return SCENES[images]

    monkeypatch.setattr(server_subject, "first_scene", first_scene_once)
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    # Whether a server that answers with errors speaks another protocol is no matter here.
    monkeypatch.setattr(recognition, "FIRST_S", 0.02)
    monkeypatch.setattr(recognition, "GREETING_S", 0.02)


@pytest.fixture
def examine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Outcome]]:
    monkeypatch.setattr(clients, "PAUSE_S", 0.6)
    monkeypatch.setattr(clients, "TOGETHER_S", 2.0)
    profile = tmp_path / "repeating.toml"
    profile.write_text(PROFILE)

    def outcomes(server: Server, rules: Sequence[Rule] = RULES) -> dict[str, Outcome]:
        serving: AbstractContextManager[int] = server.serving()
        with serving as port:
            address = f"openpi://127.0.0.1:{port}?patience=1&timeout=5"
            subject = open_at(address, str(profile), "tiny")
            found = Examination(lambda: subject, rules).outcomes()
        return {outcome.rule.id.removeprefix("server/"): outcome for outcome in found}

    return outcomes


def with_needs(name: str) -> list[Rule]:
    """Return a rule with those that it needs."""
    by_id = {rule.id: rule for rule in RULES}
    wanted, last = set[str](), f"server/{name}"
    while last:
        wanted.add(last)
        last = by_id[last].needs
    return [rule for rule in RULES if rule.id in wanted]


def musts_and(name: str) -> list[Rule]:
    """Return every rule of level must, and one more with those that it needs."""
    wanted = with_needs(name)
    return [rule for rule in RULES if rule.level == "must" or rule in wanted]


def broken(outcomes: dict[str, Outcome]) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == "broken"]


def test_a_sound_server_keeps_every_rule(examine: Callable[..., dict[str, Outcome]]) -> None:
    outcomes = examine(Server())
    unseen = {name for name, outcome in outcomes.items() if outcome.state != "kept"}
    assert unseen == {"contract/action-spec", "clients/pings"}, broken(outcomes)


def test_a_ping_is_seen_in_a_slow_query(examine: Callable[..., dict[str, Outcome]]) -> None:
    outcomes = examine(Slow(), with_needs("clients/pings"))
    assert outcomes["clients/pings"].state == "kept"


@pytest.mark.parametrize(("server", "name", "observed"), GALLERY, ids=[each[0].__name__ for each in GALLERY])
def test_a_mistake_breaks_its_rule_and_no_other_must(
    server: type[Server], name: str, observed: str, examine: Callable[..., dict[str, Outcome]]
) -> None:
    outcomes = examine(server(), musts_and(name))
    assert observed in " ".join(finding.observed for finding in outcomes[name].findings)
    assert all(finding.expected and finding.cure for finding in outcomes[name].broken)
    assert [each for each in broken(outcomes) if each not in MAY_ALSO_BREAK.get(server, ())] == [name]


def test_every_rule_has_a_server_that_breaks_it() -> None:
    names = {rule.id.removeprefix("server/") for rule in RULES}
    assert names == {name for _, name, _ in GALLERY} | {"contract/connects"}


@pytest.mark.parametrize("tls", [False, True], ids=["plain", "tls"])
@pytest.mark.parametrize("protocol", EACH)
def test_a_sound_server_keeps_every_must_in_each_protocol(
    protocol: str, tls: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    each = EACH[protocol]
    if tls and each.secure is None:
        pytest.skip(f"{protocol} has no form with TLS")
    with each.serve() as plain, forwarded(plain, tls=True) as secured:
        scheme, port = (each.secure, secured) if tls else (protocol, plain)
        address = f"{scheme}://127.0.0.1:{port}?patience=5&timeout=20"
        subject = open_at(address, each.profile, "tiny", *each.cadence)
        musts = [rule for rule in RULES if rule.level == "must"]
        outcomes = {outcome.rule.id: outcome for outcome in Examination(lambda: subject, musts).outcomes()}
    assert not [id for id, outcome in outcomes.items() if outcome.fails]
    assert outcomes["server/contract/answers"].state == outcomes["server/errors/survives"].state == "kept"


@pytest.mark.parametrize(("protocol", "profile", "path", "batch"), OWN)
def test_the_server_of_this_package_keeps_every_rule(
    protocol: str, profile: str, path: str, batch: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "PAUSE_S", 0.3)
    repeating = tmp_path / "repeating.toml"
    repeating.write_text(f'extends = "{profile}"\n[policy]\nname = "x"\nrepeatable = true\n')
    host = Host(BatchedPolicy(), "adapter abc", batching=Batching(batch, 0.02))
    with serving(host, port=0) as (port, _):
        address = f"{protocol}://127.0.0.1:{port}{path}?patience=5&timeout=20"
        subject = open_at(address, profile if protocol == "openpi" else str(repeating), "tiny")
        outcomes = Examination(lambda: subject, RULES).outcomes()
    assert not [outcome for outcome in outcomes if outcome.state == "broken"]


def test_a_server_that_is_not_there_breaks_the_first_rule(tmp_path: Path) -> None:
    profile = tmp_path / "repeating.toml"
    profile.write_text(PROFILE)
    with Server().serving() as port:
        pass

    def opens() -> object:
        return open_at(f"openpi://127.0.0.1:{port}?patience=0.1", str(profile), "tiny")

    outcomes = Examination(opens, RULES).outcomes()
    assert [outcome.rule.id for outcome in outcomes if outcome.state == "broken"] == [contract.CONNECTS]
