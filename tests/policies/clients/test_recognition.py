"""Every wrong pairing of a client and a server ends within 5 s with the name of the protocol that answers."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients import recognition
from pytest_libero_max.policies.clients.opening import load_served, parse_address
from pytest_libero_max.policies.clients.recognition import recognise
from tests.policies.clients import fakes
from tests.policies.clients.each_protocol import EACH, accepting
from tests.policies.clients.pairings import SERVERS, first_line


@pytest.fixture(scope="module", params=SERVERS)
def server(request: pytest.FixtureRequest) -> Iterator[tuple[str, int]]:
    with SERVERS[request.param].serve() as port:
        yield request.param, port


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recognition, "SILENT_S", 0.1)


@pytest.mark.parametrize("client", EACH)
def test_a_server_of_another_protocol_is_named(client: str, server: tuple[str, int]) -> None:
    kind = SERVERS[server[0]]
    line, took_s = first_line(client, server[1], kind.path)
    assert (line is None) == (client in kind.speaks)
    if line is not None:
        assert kind.named in line
        assert "tried" not in line
    assert took_s < 5.0


def told(talk: bytes, own: str = "openpi") -> str | None:
    """What is recognised of a server that begins with some bytes."""

    def speak(connection: socket.socket) -> None:
        connection.sendall(talk)
        connection.recv(2**16)

    with accepting(speak) as port:
        return recognise(parse_address(f"{own}://127.0.0.1:{port}"), own)


def test_programs_that_serve_no_policy_are_named() -> None:
    assert str(told(b"SSH-2.0-OpenSSH_9.2\r\n")).startswith("An SSH server")
    assert "gRPC" in str(told(b"\x00\x00\x12\x04\x00\x00\x00\x00\x00" + bytes(18)))
    assert told(b"220 mail ESMTP\r\n") is None


def test_a_greeting_that_does_not_come_is_called_that(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A server that opens a WebSocket, and is neither openpi's nor vla-eval's."""
    monkeypatch.setattr(recognition, "LOOK_S", 0.5)
    began = time.monotonic()
    with (
        fakes.websocket(lambda message: fakes.NO_REPLY) as port,
        pytest.raises(ServerError, match=r"openpi.* not come within 1\.5 s"),
    ):
        load_served(f"openpi://127.0.0.1:{port}?timeout=1.5&patience=0.1", "pi05_libero")
    assert time.monotonic() - began < 5.0
    assert "has not come" in caplog.text


def test_a_server_that_asks_for_a_token_is_not_taken_for_another() -> None:
    with SERVERS["libero-max serve"].serve() as port:
        assert recognise(parse_address(f"openpi://127.0.0.1:{port}/nowhere"), "openpi") is None


def test_a_profile_that_does_not_fit_the_server_is_told_at_once() -> None:
    with SERVERS["libero-max serve"].serve() as port:
        address = f"openpi://127.0.0.1:{port}"
        with pytest.raises(AdapterError, match=r"'pi05_libero' lacks.*profile=served"):
            load_served(address, "pi05_libero")
        load_served(address, "served").client.close()
    with EACH["openpi"].serve() as port, pytest.raises(ServerError, match="no server of"):
        load_served(f"openpi://127.0.0.1:{port}", "served")
