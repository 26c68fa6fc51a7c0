"""Statuses and redirects, over HTTP and WebSockets: told at once, with what to do."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress

import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients import recognition
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.opening import parse_address
from pytest_libero_max.policies.clients.transport import Refused, Unreachable, redirected, status_error
from tests.policies.clients import fakes
from tests.policies.clients.each_protocol import EACH, accepting, ask

OVER_HTTP = ("openpi", "vla-eval", "starvla", "http")


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look briefly whether a server speaks another protocol: none does here."""
    for name in ("FIRST_S", "GREETING_S"):
        monkeypatch.setattr(recognition, name, 0.05)
    monkeypatch.setattr(recognition, "LOOK_S", 0.5)


def answering(status: str, *headers: str, seen: list[str] | None = None) -> Callable[[socket.socket], None]:
    """A server that answers everything alike."""

    def talk(connection: socket.socket) -> None:
        with suppress(OSError):
            asked = connection.recv(2**20).decode("latin-1")
            if seen is not None:
                seen.append(asked)
            lines = [f"HTTP/1.1 {status}", "Server: balancer", "Content-Length: 3", *headers, "", "no\n"]
            connection.sendall("\r\n".join(lines).encode())
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(2**16):
                pass

    return talk


def refusal(scheme: str, port: int) -> tuple[str, float]:
    began = time.monotonic()
    with pytest.raises(ServerError) as caught:
        ask(EACH[scheme].open(f"{scheme}://127.0.0.1:{port}?patience=20"))
    return str(caught.value), time.monotonic() - began


@pytest.mark.parametrize("scheme", OVER_HTTP)
@pytest.mark.parametrize("status", ["401 Unauthorized", "403 Forbidden"])
def test_a_token_that_is_missing_is_named_at_once(scheme: str, status: str) -> None:
    with accepting(answering(status)) as port:
        text, took_s = refusal(scheme, port)
    assert f"HTTP status {status}" in text
    assert "Give the token" in text
    assert "LIBERO_MAX_SERVER_TOKEN" in text
    assert took_s < 5.0


@pytest.mark.parametrize("scheme", OVER_HTTP)
def test_a_token_is_sent_and_called_wrong_where_it_is_refused(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIBERO_MAX_SERVER_TOKEN", "secret")
    seen: list[str] = []
    with accepting(answering("401 Unauthorized", seen=seen)) as port:
        text, _ = refusal(scheme, port)
    assert "LIBERO_MAX_SERVER_TOKEN is not accepted" in text
    assert f"Authorization: {'Bearer' if scheme == 'http' else 'Api-Key'} secret" in seen[0]
    assert "secret" not in text


@pytest.mark.parametrize("scheme", OVER_HTTP)
def test_a_wrong_path_is_told_at_once(scheme: str) -> None:
    with accepting(answering("404 Not Found")) as port:
        text, took_s = refusal(scheme, port)
    assert "404 Not Found" in text
    assert "Give the path" in text
    assert took_s < 5.0


def test_a_wrong_path_over_http_is_answered_with_the_usual_one() -> None:
    with fakes.http(lambda request: (404, "no")) as port, pytest.raises(ServerError) as raised:
        ask(EACH["http"].open(f"http://127.0.0.1:{port}/nothere?patience=0.2"))
    assert "404" in str(raised.value)
    assert "/v1/infer: leave /nothere" in str(raised.value)
    assert "stands for" not in str(status_error(404, "", "/act", b"", "/act"))


@pytest.mark.parametrize("scheme", OVER_HTTP)
@pytest.mark.parametrize("status", ["302 Found", "308 Permanent Redirect"])
def test_a_redirect_to_another_host_is_named_and_not_followed(scheme: str, status: str) -> None:
    with accepting(answering(status, "Location: https://elsewhere.test/act")) as port:
        text, took_s = refusal(scheme, port)
    assert "https://elsewhere.test/act" in text
    assert took_s < 5.0


@pytest.mark.parametrize("scheme", OVER_HTTP)
def test_a_redirect_on_the_same_host_is_followed(scheme: str) -> None:
    with EACH[scheme].serve() as port:
        location = f"Location: http://127.0.0.1:{port}/v1/infer"
        with accepting(answering("307 Temporary Redirect", location)) as outer:
            policy = EACH[scheme].open(f"{scheme}://127.0.0.1:{outer}")
            assert ask(policy).shape == ask(policy, 1).shape
            policy.client.close()


@pytest.mark.parametrize("scheme", OVER_HTTP)
def test_a_redirect_without_end_is_refused(scheme: str) -> None:
    with accepting(answering("307 Temporary Redirect", "Location: /again")) as port:
        assert "from address to" in refusal(scheme, port)[0]


def test_a_server_that_has_answered_is_waited_for_whatever_a_balancer_says() -> None:
    good = {"actions": [[0.0] * 7] * 10}
    answers: list[object] = [good, (404, "no backend"), (401, "no backend"), good]
    with fakes.http(lambda request: answers.pop(0)) as port:
        policy = EACH["http"].open(f"http://127.0.0.1:{port}?patience=10")
        assert ask(policy).shape == ask(policy, 1).shape
        assert policy.client.interruptions == 1
        policy.client.close()


@pytest.mark.parametrize(
    ("status", "kind"),
    [
        (401, Refused),
        (404, Refused),
        (301, Refused),
        (502, Unreachable),
        (503, Unreachable),
        (504, Unreachable),
    ],
)
def test_a_status_says_whether_asking_again_helps(status: int, kind: type[ServerError]) -> None:
    assert type(status_error(status, "", "/", b"")) is kind


@pytest.mark.parametrize(
    ("address", "location", "expected"),
    [
        ("http://gpu/act", "https://gpu/act", "https://gpu:443/act"),
        ("http://gpu:8000/act", "/v2/act?x=1", "http://gpu:8000/v2/act?x=1"),
        ("openpi://gpu:8000", "wss://gpu/ws", "openpi+tls://gpu:443/ws"),
        ("openpi+tls://gpu", "ws://gpu/ws", None),
        ("openpi://gpu:8000", "ws://gpu.elsewhere/ws", None),
        ("openpi://gpu:8000", "mailto:me", None),
        ("openpi://gpu:8000", None, None),
    ],
)
def test_redirects_stay_on_the_host_and_never_lose_tls(
    address: str, location: str | None, expected: str | None
) -> None:
    parsed: Address = parse_address(address)
    if expected is None:
        with pytest.raises(Refused, match="307 sends to"):
            redirected(parsed, location, 307)
    else:
        assert str(redirected(parsed, location, 307)) == expected
