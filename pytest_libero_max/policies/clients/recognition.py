"""Recognises the protocol that a server speaks, where it is not the one that it is asked in.

A few bytes tell: ZeroMQ greets first, a server of HTTP refuses to open a WebSocket, openpi's greets when it
is open, starVLA's answers to a ping, and vla-eval's to a hello. Nothing is asked that a policy would compute.
A server that is busy is silent, and is not recognised.
"""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from threading import Event, Timer
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.codecs import OPENPI, VLA_EVAL, pack, unpack
from pytest_libero_max.policies.clients.connection import (
    answer_in_place,
    connect,
    open_websocket,
    speaks_tls,
)
from pytest_libero_max.policies.clients.transport import LOG, OtherProtocol

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

SILENT_S = 1.0
"""Time after which a silent server is looked at, s."""

LOOK_S = 2.5
"""Longest time to look at a server, s; a recognised server is reported within 5 s."""

FIRST_S = 0.25
"""Time for the first bytes of a server that greets before it is asked, s."""

GREETING_S = 0.5
"""Time for the greeting of openpi's protocol once the WebSocket is open, s."""

_MOST_BYTES = 2**16
_ZEROMQ = (b"\xff", 9, b"\x7f")
_SSH = b"SSH-"
_HTTP_SERVERS = (
    "uvicorn",
    "hypercorn",
    "gunicorn",
    "werkzeug",
    "aiohttp",
    "basehttp",
    "simplehttp",
    "waitress",
)
"""First words of the header ``Server`` of programs that answer themselves, as balancers do not."""


@dataclass(frozen=True)
class Speech:
    """The protocol that a server speaks."""

    protocol: str
    """Scheme of its addresses; empty for one that this package does not speak."""
    name: str
    profile: str = ""
    """Words that name a fitting profile."""
    path: str | None = None
    """Path of the address; None for that of the address that was asked."""
    also: tuple[str, str] | None = None
    """Another address of the same server, as protocol and path."""

    def sentence(self, address: Address) -> str:
        """Return what was recognised at an address, and how to ask it."""
        if not self.protocol:
            return f"{self.name} answers there."
        ways = [f"{self._written(address, self.protocol, self.path)} {self.profile}".rstrip()]
        if self.also is not None:
            ways.append(self._written(address, *self.also))
        return f"{self.name} answers there: ask {', or '.join(ways)}."

    def _written(self, address: Address, protocol: str, path: str | None) -> str:
        there = address.over(protocol, address.secure)
        return str(replace(there, path=address.path if path is None else path))


def _family(protocol: str) -> str:
    return f"with a profile for {protocol}:// (`libero-max list profiles` lists them)"


SERVED = Speech(
    "openpi",
    "`libero-max serve`",
    "with --libero-max-profile=served",
    path="",
    also=("vla-eval", "/vla-eval"),
)
OPENPI_SERVER = Speech("openpi", "A server in openpi's protocol", _family("openpi"))
STARVLA = Speech("starvla", "A server of the starVLA family", _family("starvla"))
VLA_EVAL_SERVER = Speech("vla-eval", "A model server of vla-eval", _family("vla-eval"))
GR00T = Speech("gr00t", "A server over ZeroMQ, as GR00T's,", _family("gr00t"), path="")
HTTP = Speech("http", "A server of HTTP", _family("http"), path="")
SSH = Speech("", "An SSH server")
GRPC = Speech("", "A server of gRPC, as LeRobot's asynchronous inference, whose pickles are never read,")


def recognise(address: Address, own: str) -> str | None:
    """Return a sentence about a server that speaks another protocol than it is asked in; None for others."""
    speech = _tried(address, own)
    if speech is not None:
        return None if speech.protocol == own else speech.sentence(address)
    other = address.over(own, not address.secure)
    if not address.secure and not speaks_tls(address, GREETING_S):
        return None
    speech = _tried(other, own)  # with TLS only where the certificate is trusted
    if speech is not None:
        return f"{'Without' if address.secure else 'With'} TLS: {speech.sentence(other)}"
    if address.secure:
        return None
    return f"A server with TLS answers there{'' if own == GR00T.protocol else f': write {other}'}."


def _tried(address: Address, own: str) -> Speech | None:
    try:
        return _speech(address, own, time.monotonic() + LOOK_S)
    except (ServerError, OSError):
        return None


def other_protocol(speech: Speech, address: Address, own: str) -> OtherProtocol:
    """Return the error of a server that speaks another protocol than it is asked in."""
    return OtherProtocol(f"is no server for {own}://. {speech.sentence(address)}")


@contextmanager
def watched(connection: socket.socket, address: Address, own: str, silence: str = "") -> Iterator[None]:
    """Look at a server that is silent while the block waits; if it speaks another protocol, end the wait."""
    sentences: list[str] = []
    over = Event()

    def look() -> None:
        sentence = recognise(address, own)
        if over.is_set():
            return
        if sentence is None:
            LOG.log(logging.WARNING if silence else logging.DEBUG, "policy server %s: %s", address, silence)
            return
        sentences.append(sentence)
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)

    timer = Timer(SILENT_S, look)
    timer.daemon = True
    timer.start()
    try:
        yield
    except ServerError as error:
        if sentences:
            raise OtherProtocol(f"is no server for {own}://. {sentences[0]}") from error
        raise
    finally:
        over.set()
        timer.cancel()


def _speech(address: Address, own: str, until: float) -> Speech | None:
    from websockets.exceptions import WebSocketException

    with closing(connect(address)) as connection:
        if not address.secure:  # what is encrypted cannot be read without being taken
            speech = _of_first_bytes(_peeked(connection))
            if speech is not None:
                return speech
        try:
            with open_websocket(connection, address, LOOK_S, _MOST_BYTES) as websocket:
                return _of_websocket(websocket, own, until)
        except (WebSocketException, EOFError, ValueError) as error:
            answer = answer_in_place(error)
    if answer is None or (answer.status_code >= 500 and answer.status_code != 501):
        return None
    return _of_http(address, until)


def _peeked(connection: socket.socket) -> bytes:
    connection.settimeout(FIRST_S)
    until = time.monotonic() + FIRST_S
    seen = b""
    with suppress(OSError):
        while len(seen) < 10 and time.monotonic() < until:
            seen = connection.recv(64, socket.MSG_PEEK)
            if not seen:
                break
            time.sleep(0.01)  # the rest of a greeting that came in parts
    return seen


def _of_first_bytes(seen: bytes) -> Speech | None:
    first, place, last = _ZEROMQ
    if seen[:1] == first and seen[place : place + 1] == last:
        return GR00T
    if seen.startswith(_SSH):
        return SSH
    return GRPC if len(seen) >= 9 and seen[3] == 4 and not any(seen[5:9]) else None


def _of_websocket(websocket: ClientConnection, own: str, until: float) -> Speech | None:
    greeting = _message(websocket, min(until, time.monotonic() + GREETING_S))
    if greeting is None:
        payload = {"harness_version": "pytest-libero-max", "protocol_version": 1, "benchmark": "libero-max"}
        hello = {"type": "hello", "payload": payload, "seq": 1, "timestamp": time.time()}
        reply = _message(websocket, until, pack(hello, VLA_EVAL))
        return VLA_EVAL_SERVER if isinstance(reply, Mapping) and reply.get("type") == "hello" else None
    known = of_greeting(greeting)
    if known is not None or own == "openpi":  # an openpi server would take the ping for an observation
        return known or OPENPI_SERVER
    ping = pack({"type": "ping", "request_id": "libero-max", "payload": {}}, OPENPI)
    return STARVLA if is_starvla_reply(_message(websocket, until, ping)) else OPENPI_SERVER


def _message(websocket: ClientConnection, until: float, request: bytes | None = None) -> Any:
    """Return the value of the next message, text as it is; None where none comes in time."""
    from websockets.exceptions import ConnectionClosed

    try:
        if request is not None:
            websocket.send(request)
        content = websocket.recv(timeout=max(until - time.monotonic(), 0.0))
    except (TimeoutError, ConnectionClosed):
        return None
    try:
        return content if isinstance(content, str) else unpack(content, OPENPI)
    except ServerError:
        return b""


def of_greeting(greeting: Any) -> Speech | None:
    """Return the kind of server that a greeting of openpi's protocol declares; None where it does not."""
    if not isinstance(greeting, Mapping):
        return None
    if "libero_max" in greeting:
        return SERVED
    return STARVLA if greeting.get("env") == "starvla_policy_server" else None


def is_starvla_reply(reply: Any) -> bool:
    """Return True for a reply in the envelope of the starVLA family."""
    return isinstance(reply, Mapping) and isinstance(reply.get("ok"), bool) and "request_id" in reply


def _of_http(address: Address, until: float) -> Speech | None:
    """Return the speech of a server that opened no WebSocket; None for a balancer and at a wrong path."""
    from http.client import HTTPException

    try:
        program, content = _got(address, "/openapi.json", until)
    except (HTTPException, ServerError, OSError):
        return None
    with suppress(ValueError, RecursionError, AttributeError, TypeError):
        posts = [path for path, ways in json.loads(content)["paths"].items() if "post" in ways]
        return replace(HTTP, name=f"A server of HTTP (POST {', '.join(posts[:4])})")
    if program.lower().startswith(_HTTP_SERVERS):
        return replace(HTTP, name=f"A server of HTTP ({program})")
    return None


def _got(address: Address, path: str, until: float) -> tuple[str, bytes]:
    """Return the name of the program that answers a GET, and the body; empty where the status is not 200."""
    from http.client import HTTPConnection

    left_s = max(until - time.monotonic(), 0.1)
    connection = HTTPConnection(address.host, address.port, timeout=left_s)
    with closing(connect(address)) as connection.sock:
        connection.sock.settimeout(left_s)
        connection.request("GET", path)
        response = connection.getresponse()
        content = response.read(_MOST_BYTES) if response.status == 200 else b""
        return response.getheader("Server", ""), content
