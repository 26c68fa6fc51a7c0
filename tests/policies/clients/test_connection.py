"""What cannot be reached is told soon, in the same words for every protocol; what is silent is waited for."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients import connection, recognition
from pytest_libero_max.policies.clients.opening import parse_address
from pytest_libero_max.policies.clients.protocols import http
from pytest_libero_max.policies.clients.recognition import recognise
from pytest_libero_max.policies.clients.servers import read_servers
from tests.policies.clients.each_protocol import CERTIFICATE, EACH, accepting, ask, forwarded

BY_SCHEME = {
    **EACH,
    **{each.secure: each for each in EACH.values() if each.secure is not None},
}
SECURE = [name for name in BY_SCHEME if name not in EACH]


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "CONNECT_S", 0.4)
    monkeypatch.setattr(recognition, "SILENT_S", 0.1)
    monkeypatch.setattr(recognition, "FIRST_S", 0.05)


def told(scheme: str, where: str) -> tuple[str, float]:
    """What is said of a server that cannot be reached, and after how many seconds."""
    began = time.monotonic()
    with pytest.raises(ServerError) as caught:
        BY_SCHEME[scheme].open(f"{scheme}://{where}?patience=0.3")
    return str(caught.value), time.monotonic() - began


@contextmanager
def firewall() -> Iterator[int]:
    """A port at which connections are neither accepted nor refused: its queue is full."""
    with socket.socket() as server, ExitStack() as waiting:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        for _ in range(2):
            client = waiting.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(server.getsockname())
        yield server.getsockname()[1]


@pytest.mark.parametrize("scheme", BY_SCHEME)
def test_a_closed_port_is_told(scheme: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    text, took_s = told(scheme, f"127.0.0.1:{port}")
    assert f"{scheme}://127.0.0.1:{port}: cannot be reached" in text
    assert took_s < 5.0


@pytest.mark.parametrize("scheme", BY_SCHEME)
def test_an_unknown_host_is_told(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*arguments: Any) -> Any:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    text, took_s = told(scheme, "gpu-bx:8000")
    assert "called 'gpu-bx'" in text
    assert took_s < 5.0


@pytest.mark.parametrize("scheme", BY_SCHEME)
def test_a_name_server_that_does_not_answer_is_told(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = threading.Event()

    def silent(*arguments: Any) -> Any:
        answer.wait(30.0)
        return []

    monkeypatch.setattr(socket, "getaddrinfo", silent)
    text, took_s = told(scheme, "gpu-box:8000")
    assert "name 'gpu-box'" in text
    assert took_s < 5.0
    assert read_servers(f"{scheme}://a", BY_SCHEME[scheme].profile).resolved().addresses == (f"{scheme}://a",)
    answer.set()


@pytest.mark.parametrize("scheme", BY_SCHEME)
def test_a_firewall_is_told(scheme: str) -> None:
    with firewall() as port:
        text, took_s = told(scheme, f"127.0.0.1:{port}")
    assert "0.4 s: a firewall" in text
    assert "tried 1 time" in text  # another try would take as long, and end beyond the patience
    assert took_s < 5.0


@pytest.mark.parametrize("scheme", EACH)
def test_a_server_is_reached_over_ipv6(scheme: str) -> None:
    with EACH[scheme].serve() as port, forwarded(port, "::1") as outer:
        policy = EACH[scheme].open(f"{scheme}://[::1]:{outer}")
        assert ask(policy).shape[1] == 7
        policy.client.close()


def test_another_number_of_a_host_is_tried_where_one_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name with an IPv6 address that leads nowhere, and an IPv4 address."""
    with firewall() as dead, EACH["gr00t"].serve() as port:
        found = [
            (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", number)) for number in (dead, port)
        ]
        monkeypatch.setattr(connection, "look_up", lambda *arguments: found)
        connection.connect(parse_address(f"openpi://gpu-box:{port}")).close()


@pytest.mark.parametrize("scheme", [name for name in BY_SCHEME if name != "gr00t"])
def test_a_connection_that_is_accepted_and_silent_is_an_answer_under_way(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A server of one thread that computes: the system accepts, and nothing is read until it has finished."""
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    monkeypatch.setattr(recognition, "LOOK_S", 0.2)
    each = BY_SCHEME[scheme]
    with each.serve() as port, forwarded(port, tls=scheme in SECURE, silent_s=0.5) as outer:
        policy = each.open(f"{scheme}://127.0.0.1:{outer}?timeout=20&patience=0.1")
        assert ask(policy).shape[1] == 7
        policy.client.close()
    assert (policy.client.interruptions, policy.client.waited_s) == (0, 0.0)


def test_tickets_of_tls_are_no_end_of_a_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server sends them after the handshake, so that the first query finds the connection readable."""
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    each, opened = BY_SCHEME["https"], list[Any]()

    def connect(address: Any) -> socket.socket:
        opened.append(address)
        return connection.connect(address)

    monkeypatch.setattr(http, "connect", connect)
    with each.serve() as port, forwarded(port, tls=True) as outer:
        policy = each.open(f"https://127.0.0.1:{outer}")
        sock = policy.client.link._connection.sock  # type: ignore[attr-defined]
        assert select.select([sock], [], [], 10.0)[0]
        assert ask(policy).shape[1] == ask(policy, 1).shape[1] == 7
        policy.client.close()
    assert len(opened) == 1


@pytest.mark.parametrize("scheme", SECURE)
def test_a_server_behind_tls_is_asked(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    with BY_SCHEME[scheme].serve() as port, forwarded(port, tls=True) as outer:
        policy = BY_SCHEME[scheme].open(f"{scheme}://localhost:{outer}")
        assert ask(policy).shape[1] == ask(policy, 1).shape[1] == 7
        assert policy.server == f"{scheme}://localhost:{outer}"
        policy.client.close()


@pytest.mark.parametrize("scheme", SECURE)
def test_tls_that_cannot_be_is_told_at_once(scheme: str) -> None:
    each = BY_SCHEME[scheme]
    plain = next(name for name, other in EACH.items() if other is each)
    with each.serve() as port, forwarded(port, tls=True) as outer:
        with pytest.raises(ServerError, match=r"not trusted.*SSL_CERT_FILE"):
            each.open(f"{scheme}://127.0.0.1:{outer}")
        with pytest.raises(ServerError, match=rf"TLS.*{plain}://127.0.0.1:{port}"):
            each.open(f"{scheme}://127.0.0.1:{port}")
        with pytest.raises(ServerError, match=rf"TLS answers.*{scheme.replace('+', '.')}://"):
            ask(each.open(f"{plain}://127.0.0.1:{outer}?patience=0.1"))


def test_a_protocol_without_tls_says_what_there_is() -> None:
    with pytest.raises(AdapterError, match=r"ssh -N -L 5555.*gr00t://127.0.0.1:5555"):
        parse_address("gr00t+tls://gpu-box")
    with pytest.raises(AdapterError, match="https://"):
        parse_address("http+tls://gpu-box")
    address = parse_address("openpi+tls://gpu-box/policy")
    assert (address.protocol, address.port, address.secure) == ("openpi", 443, True)


def test_a_forwarder_with_nothing_behind_it_is_waited_for_and_not_mistaken() -> None:
    """As `ssh -L` and Docker's proxy: the connection is accepted, and closed."""
    with accepting(lambda opened: None) as port:
        for scheme in EACH:
            assert recognise(parse_address(f"{scheme}://127.0.0.1:{port}"), scheme) is None
            with pytest.raises(ServerError, match=r"tried [1-9]"):
                ask(EACH[scheme].open(f"{scheme}://127.0.0.1:{port}?patience=0.1"))
