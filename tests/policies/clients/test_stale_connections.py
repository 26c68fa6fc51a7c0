"""A connection that a server closes between two queries is opened again at once, and is no interruption."""

from __future__ import annotations

import json
import socket
import ssl
import threading
import time
from contextlib import suppress
from http.client import HTTPConnection
from importlib import import_module
from typing import Any

import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.codecs import MSGPACK_NUMPY, OPENPI, pack
from pytest_libero_max.policies.clients.protocols import http
from pytest_libero_max.policies.clients.transport import Client, StaleConnection, Unreachable
from tests.policies.clients import fakes
from tests.policies.clients.each_protocol import EACH, ROWS, accepting, ask, gr00t_reply
from tests.policies.clients.test_link import Clock, Script

BODY = json.dumps({"actions": ROWS}).encode()


def request_of(connection: socket.socket) -> bool:
    """Read a POST; False where the client has gone, or asks something else."""
    head = b""
    while b"\r\n\r\n" not in head:
        data = connection.recv(2**16)
        if not data:
            return False
        head += data
    head, _, body = head.partition(b"\r\n\r\n")
    if not head.startswith(b"POST"):
        return False
    length = int(head.lower().split(b"content-length:")[1].split()[0])
    while len(body) < length:
        body += connection.recv(2**16)
    return True


def reply_to(connection: socket.socket) -> None:
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(BODY) + BODY)


def counts(policy: Any) -> tuple[int, float]:
    policy.client.close()
    return policy.client.interruptions, policy.client.waited_s


def test_a_server_that_closes_idle_connections_is_not_interrupted() -> None:
    opened: list[int] = []

    def talk(connection: socket.socket) -> None:
        opened.append(1)
        request_of(connection)
        reply_to(connection)
        time.sleep(0.05)  # then it closes the connection, which the answer did not announce

    with accepting(talk) as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}")
        for index in range(3):
            began = time.monotonic()
            assert ask(policy, index).shape == (10, 7)
            took_s = time.monotonic() - began
            time.sleep(0.3)
        assert took_s < 0.25 - 0.05  # no pause of the retries in it
    assert (len(opened), counts(policy)) == (3, (0, 0.0))


def test_news_that_cross_a_request_are_no_interruption_and_the_query_is_asked_again() -> None:
    asked: list[int] = []

    def talk(connection: socket.socket) -> None:
        while request_of(connection):
            asked.append(1)
            if len(asked) == 2:
                return
            reply_to(connection)

    with accepting(talk) as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}")
        assert ask(policy).shape == ask(policy, 1).shape
    assert (len(asked), counts(policy)) == (3, (0, 0.0))


def test_a_connection_that_is_closed_before_the_first_query_is_opened_again() -> None:
    """The scene is built between the opening and the first query, which takes longer than uvicorn's 5 s."""
    opened: list[int] = []

    def talk(connection: socket.socket) -> None:
        opened.append(1)
        if len(opened) > 1:
            request_of(connection)
            reply_to(connection)

    with accepting(talk) as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}")
        time.sleep(0.2)
        assert ask(policy).shape == (10, 7)
    assert (len(opened), counts(policy)) == (2, (0, 0.0))


@pytest.mark.parametrize(
    "end", [BrokenPipeError("Broken pipe"), ssl.SSLEOFError(8, "EOF occurred in violation of protocol")]
)
def test_an_end_that_is_met_while_the_request_is_sent_is_no_interruption(
    end: OSError, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind TLS it is no ConnectionError: OpenSSL names it in its own way."""
    send, sent = HTTPConnection.request, []

    def request(connection: Any, *arguments: Any) -> None:
        sent.append(1)
        if len(sent) == 2:
            raise end
        send(connection, *arguments)

    monkeypatch.setattr(HTTPConnection, "request", request)
    with EACH["http"].serve() as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}")
        assert ask(policy).shape == ask(policy, 1).shape
        assert (len(sent), counts(policy)) == (3, (0, 0.0))


@pytest.mark.parametrize("failure", ["again", "after a while", "in the answer"])
def test_any_other_lost_answer_is_an_interruption(failure: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http, "CROSSING_S", 0.1)
    asked: list[int] = []

    def talk(connection: socket.socket) -> None:
        while request_of(connection):
            asked.append(1)
            if len(asked) == 2 or (failure == "again" and len(asked) == 3):
                if failure == "after a while":
                    time.sleep(0.3)
                if failure == "in the answer":
                    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{")
                return
            reply_to(connection)

    with accepting(talk) as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}")
        assert ask(policy).shape == ask(policy, 1).shape
    assert counts(policy)[0] == 1


def test_a_websocket_that_was_closed_between_queries_is_opened_again() -> None:
    from websockets.sync.server import ServerConnection, serve

    def talk(connection: ServerConnection) -> None:
        connection.send(pack({}, OPENPI))
        connection.recv()
        connection.send(pack({"actions": ROWS}, OPENPI))

    with serve(talk, "127.0.0.1", 0, compression=None, max_size=None, logger=fakes.QUIET) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        policy = EACH["openpi"].open(f"openpi://127.0.0.1:{server.socket.getsockname()[1]}")
        for index in range(3):
            assert ask(policy, index).shape == (10, 7)
            time.sleep(0.1)
        server.shutdown()
    assert counts(policy) == (0, 0.0)


def test_a_server_of_zeromq_that_was_started_again_between_queries_is_asked_at_once() -> None:
    with EACH["gr00t"].serve() as port:
        policy = EACH["gr00t"].open(f"gr00t://127.0.0.1:{port}?timeout=5")
        assert ask(policy).shape == (16, 7)
    with fakes.zeromq(gr00t_reply, MSGPACK_NUMPY, port):
        time.sleep(0.1)
        assert ask(policy, 1).shape == (16, 7)
        assert counts(policy) == (0, 0.0)


def test_a_server_of_zeromq_that_dies_while_it_computes_is_told_at_once() -> None:
    """Not after ?timeout, for which ZeroMQ waits in silence."""
    zmq: Any = import_module("zmq")
    context = zmq.Context()
    server = context.socket(zmq.REP)
    server.linger = 0
    port = server.bind_to_random_port("tcp://127.0.0.1")

    def die() -> None:
        server.recv()
        server.send(pack({"status": "ok"}, MSGPACK_NUMPY))
        server.recv()
        server.close()
        context.term()

    thread = threading.Thread(target=die, daemon=True)
    thread.start()
    policy = EACH["gr00t"].open(f"gr00t://127.0.0.1:{port}?timeout=60&patience=0.5")
    began = time.monotonic()
    with pytest.raises(ServerError, match=r"was lost|nothing listens"):
        ask(policy)
    thread.join(5)
    policy.client.close()
    assert time.monotonic() - began < 10.0


def test_a_connection_is_opened_again_once_for_a_query(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    link = Script(
        "one", StaleConnection("closed"), "two", StaleConnection("closed"), Unreachable("gone"), "three"
    )
    client = Client("server", link, 60.0, sleep=clock.sleep)
    assert [client.ask("?", str) for _ in range(2)] == ["one", "two"]
    assert (client.interruptions, clock.pauses, link.opened) == (0, [], 2)
    with suppress(ServerError):
        assert client.ask("?", str) == "three"
    assert (client.interruptions, clock.pauses, link.opened) == (1, [0.25], 4)
