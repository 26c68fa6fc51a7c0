"""What goes wrong on the wire: lost connections, restarts, silence, error replies, useless replies."""

from __future__ import annotations

import gzip
import socket
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.http11 import Request
from websockets.server import ServerProtocol

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients import recognition, transport
from pytest_libero_max.policies.clients.codecs import MSGPACK_NUMPY, NPY, OPENPI, pack
from pytest_libero_max.policies.clients.opening import load_served, parse_address
from pytest_libero_max.policies.clients.protocols import http
from pytest_libero_max.policies.clients.protocols.http import unpacked
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.clients.websocket import Socket
from tests.policies.clients import fakes

GOOD = {"actions": np.zeros((10, 7))}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    monkeypatch.setattr(transport, "LONGEST_PAUSE_S", 0.05)
    for name, seconds in (("FIRST_S", 0.05), ("GREETING_S", 0.1), ("LOOK_S", 0.5)):
        monkeypatch.setattr(recognition, name, seconds)


def connect(scheme: str, port: int, profile: str, options: str = "patience=10") -> ServedPolicy:
    policy = load_served(f"{scheme}://127.0.0.1:{port}?{options}", profile)
    policy.reset(fakes.EPISODE)
    return policy


def ask(policy: ServedPolicy) -> Any:
    try:
        return policy.predict(fakes.observation(), fakes.query())
    finally:
        policy.client.close()


BAD: list[tuple[Any, str]] = [
    ("Traceback ...\nValueError: no GPU", "the server reports an error: 'ValueError: no GPU'"),
    (b"\xc1", "no msgpack document"),
    (pack([1, 2], OPENPI), "a message is a list"),
    ({"action": np.zeros((10, 7))}, r"the keys \['action'\], but the profile takes the actions from actions"),
    ({"actions": "none"}, "must be numbers"),
    ({"actions": np.zeros((10, 6))}, r"\(10, 6\), but must have \(n, 7\)"),
    ({"actions": np.zeros((4, 7))}, r"4 actions, but Q=5 are executed"),
    ({"actions": np.zeros((0, 7))}, r"0 actions, but Q=5"),
    ({"actions": np.zeros((2, 10, 7))}, "must be numbers"),
    ({"actions": [[0.0] * 7, [0.0] * 6]}, "no array"),
    ({"actions": np.full((10, 7), np.nan)}, r"actions\[0, 0\]=nan, but every component must be finite"),
    ({"actions": np.array([[0.0] * 7] * 9 + [[0.0] * 6 + [np.inf]])}, r"actions\[9, 6\]=inf"),
]


@pytest.mark.parametrize(("answer", "message"), BAD)
def test_a_useless_answer_is_an_error_of_the_server_after_three_tries(answer: Any, message: str) -> None:
    asked: list[int] = []

    def handle(request: Any) -> Any:
        asked.append(1)
        return answer

    with fakes.openpi(handle) as port, pytest.raises(ServerError, match=message):
        ask(connect("openpi", port, "pi05_libero"))
    assert len(asked) == 3


def test_one_bad_answer_is_forgiven() -> None:
    answers = [{"actions": np.full((10, 7), np.nan)}, "Traceback", GOOD]
    with fakes.openpi(lambda request: answers.pop(0)) as port:
        policy = connect("openpi", port, "pi05_libero")
        assert ask(policy).shape == (10, 7)
        assert policy.client.interruptions == 1


def test_an_answer_larger_than_the_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from pytest_libero_max.policies.clients import websocket

    monkeypatch.setattr(websocket, "MOST_BYTES", 10_000)
    with (
        fakes.openpi(lambda request: {"actions": np.zeros((1000, 7))}) as port,
        pytest.raises(ServerError, match="more than 10000 bytes"),
    ):
        ask(connect("openpi", port, "pi05_libero"))


def test_a_server_that_hangs_up_once_is_asked_again() -> None:
    answers = [None, GOOD]
    with fakes.openpi(lambda request: answers.pop(0)) as port:
        policy = connect("openpi", port, "pi05_libero")
        assert ask(policy).shape == (10, 7)
        assert policy.client.interruptions == 1


def test_a_server_that_is_killed_and_started_again_is_waited_for() -> None:
    with ExitStack() as later:
        with fakes.openpi(lambda request: GOOD) as port:
            policy = connect("openpi", port, "pi05_libero")
            policy.predict(fakes.observation(), fakes.query())

        def start() -> None:
            time.sleep(0.3)
            later.enter_context(fakes.openpi(lambda request: GOOD, port=port))

        thread = threading.Thread(target=start)
        thread.start()
        assert ask(policy).shape == (10, 7)
        thread.join()
        assert policy.client.interruptions == 1
        assert policy.client.waited_s > 0.2


def after(seconds: float, answer: Any) -> Any:
    time.sleep(seconds)
    return answer


def silent(request: Any) -> Any:
    return after(0.5, GOOD)


def test_a_late_answer_is_not_taken_for_that_of_the_next_query() -> None:
    late = {"actions": np.ones((10, 7))}
    answers: list[Callable[[], Any]] = [lambda: after(0.3, late), lambda: GOOD]
    with fakes.openpi(lambda request: answers.pop(0)()) as port:
        policy = connect("openpi", port, "pi05_libero", "patience=10&timeout=0.1")
        assert not ask(policy).any()


@pytest.mark.parametrize(
    ("scheme", "profile", "serve"),
    [
        ("openpi", "pi05_libero", lambda: fakes.openpi(silent)),
        ("http", "dm05", lambda: fakes.http(lambda request: after(0.5, (200, "{}")))),
        ("gr00t", "gr00t_n17", lambda: fakes.zeromq(silent, MSGPACK_NUMPY)),
    ],
)
def test_silence_ends_after_time_and_patience(
    scheme: str, profile: str, serve: Callable[[], AbstractContextManager[int]]
) -> None:
    began = time.monotonic()
    with (
        serve() as port,
        pytest.raises(ServerError, match=r"within 0\.05 s \(\?timeout=SECONDS"),
    ):
        ask(connect(scheme, port, profile, "patience=0.2&timeout=0.05"))
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ((500, "out of memory"), "HTTP status 500.*out of memory"),
        ((404, ""), "HTTP status 404.*for /v1/infer"),
        ((200, '"error"'), "the server answered 'error'"),
        ((200, '{"error": "no image"}'), "reports an error: 'no image'"),
        ((200, "<html>"), "no JSON document.*begins with '<html>'"),
        ((200, '{"actions": [[NaN, 0, 0, 0, 0, 0, 0]]}'), "must be finite"),
        ((503, "loading"), "HTTP status 503"),
    ],
)
def test_http_errors_are_told_as_they_are(answer: Any, message: str) -> None:
    with fakes.http(lambda request: answer) as port, pytest.raises(ServerError, match=message):
        ask(connect("http", port, "dm05", "patience=0.2"))


@pytest.mark.parametrize("encoding", ["gzip", None])
def test_a_compressed_body_is_read(encoding: str | None) -> None:
    assert unpacked(gzip.compress(b'{"actions": []}'), encoding) == b'{"actions": []}'


def test_a_body_that_cannot_be_read_names_its_compression(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ServerError, match="Content-Encoding 'br'"):
        unpacked(b"x", "br")
    with pytest.raises(ServerError, match="ends too early"):
        unpacked(b"x", "gzip")
    bomb = gzip.compress(bytes(2**20))
    monkeypatch.setattr(http, "MOST_BYTES", 2**16)
    assert len(unpacked(bomb, "gzip")) == 2**16 + 1  # which is refused like any other that is too large


def test_a_reply_that_was_encoded_twice_is_read() -> None:
    rows = str([[0.0] * 6 + [1.0]] * 8)
    with fakes.http(lambda request: rows) as port:
        assert (ask(connect("http", port, "openvla_oft"))[:, 6] == -1.0).all()


@pytest.mark.parametrize(
    ("reply", "message"),
    [
        ({"ok": False, "error": {"message": "no batch_images"}}, "reports an error: 'no batch_images'"),
        ({"ok": True, "data": None}, "must have a map as 'data'"),
        ({"ok": True, "data": {"normalized_actions": np.zeros((1, 8, 7))}}, "names no statistics"),
        ({"ok": True, "data": {"tokens": 1}}, "takes the actions from actions"),
    ],
)
def test_starvla_errors_are_told_as_they_are(reply: Any, message: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'extends = "starvla"\n[policy]\nhorizon = 8\nquery_interval = 4\n[reply]\n'
        'normalised_at = ["normalized_actions"]\n'
    )
    with fakes.openpi(lambda request: reply) as port, pytest.raises(ServerError, match=message):
        ask(connect("starvla", port, str(path)))


def test_a_chunk_that_is_announced_shorter_than_q_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('extends = "starvla"\n[policy]\nhorizon = 8\nquery_interval = 8\n')
    with (
        fakes.openpi(lambda request: None, {"action_chunk_size": 4}) as port,
        pytest.raises(AdapterError, match="returns 4 actions"),
    ):
        connect("starvla", port, str(path))


@pytest.mark.parametrize(
    ("reply", "message"),
    [
        ({"error": "Unauthorized: Invalid API token"}, "Unauthorized"),
        ({"status": "ok"}, "must be a list of two maps"),
        ([1, {}], "must be a map"),
        ([{"action.x": np.zeros((1, 16, 1))}, {}], r"takes the actions from action\.x/action\.y"),
        (
            [
                {f"action.{name}": np.zeros((1, 16, 1)) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
                | {"action.gripper": np.zeros((1, 8, 1))},
                {},
            ],
            "the parts of the actions have shapes",
        ),
    ],
)
def test_gr00t_errors_are_told_as_they_are(reply: Any, message: str) -> None:
    def handle(request: Any) -> Any:
        return {"status": "ok"} if request["endpoint"] == "ping" else reply

    with fakes.zeromq(handle, MSGPACK_NUMPY) as port, pytest.raises(ServerError, match=message):
        ask(connect("gr00t", port, "gr00t_n17"))


def test_a_token_is_sent_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIBERO_MAX_SERVER_TOKEN", "secret")
    seen: list[Any] = []

    def handle(request: Any) -> Any:
        seen.append(request.get("api_token"))
        return {"status": "ok"}

    with fakes.zeromq(handle, MSGPACK_NUMPY) as port:
        connect("gr00t", port, "gr00t_n17").client.close()
    assert seen == ["secret"]


def test_the_dialect_of_gr00t_n15_has_no_envelope(tmp_path: Path) -> None:
    path = tmp_path / "n15.toml"
    path.write_text('extends = "gr00t_n17"\n[policy]\ndialect = "n1.5"\n')
    names = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")
    seen: list[Any] = []

    def handle(request: Any) -> Any:
        if request["endpoint"] == "ping":
            return {"status": "ok"}
        seen.append(request["data"])
        return {f"action.{name}": np.zeros((16,)) for name in names}

    with fakes.zeromq(handle, NPY) as port:
        assert ask(connect("gr00t", port, str(path))).shape == (16, 7)
    assert seen[0]["video.image"].shape == (1, 1, 256, 256, 3)


def test_an_answer_that_drips_ends_with_the_timeout() -> None:
    """Each byte comes in time, and the whole never does."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def drip() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    threading.Thread(target=dripped, args=(connection,), daemon=True).start()

        def dripped(connection: socket.socket) -> None:
            with suppress(OSError), connection:
                connection.recv(2**16)  # an earlier byte would look like the end
                connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
                while True:
                    connection.sendall(b" ")
                    time.sleep(0.05)

        threading.Thread(target=drip, daemon=True).start()
        began = time.monotonic()
        port = server.getsockname()[1]
        with pytest.raises(ServerError, match=r"answer came within 0\.3 s"):
            ask(connect("http", port, "dm05", "timeout=0.3&patience=0.2"))
        assert time.monotonic() - began < 10


def test_a_server_that_reads_nothing_ends_with_the_timeout() -> None:
    """A large request fills what the system holds for it, and no byte more is ever taken."""
    held = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def shake_hands() -> None:
            connection, _ = server.accept()
            held.append(connection)
            protocol = ServerProtocol()
            protocol.receive_data(connection.recv(2**16))
            (request,) = protocol.events_received()
            assert isinstance(request, Request)
            protocol.send_response(protocol.accept(request))
            connection.sendall(b"".join(protocol.data_to_send()))

        threading.Thread(target=shake_hands, daemon=True).start()
        link = Socket(parse_address(f"openpi://127.0.0.1:{server.getsockname()[1]}?timeout=0.5"))
        link.open()
        with pytest.raises(ServerError, match=r"answer came within 0\.5 s"):
            link.send(bytes(2**25))
        link.close()
        held[0].close()
