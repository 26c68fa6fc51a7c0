"""HTTP: one POST of a JSON document for each query, answered with another.

Arrays are written in one of three ways: json-numpy maps, the same as strings, and nested lists with images as
base64 files.
"""

from __future__ import annotations

import http.client
import math
import time
import zlib
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import ServerError, counted
from pytest_libero_max.policies.clients.address import Address, server_token
from pytest_libero_max.policies.clients.codecs import (
    JSON_NUMPY,
    MOST_BYTES,
    as_json_numpy_text,
    as_lists,
    from_json,
    shortened,
    to_json,
)
from pytest_libero_max.policies.clients.connection import ENDS, closed_by_peer, connect
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.recognition import watched
from pytest_libero_max.policies.clients.transport import (
    MOST_REDIRECTS,
    Refused,
    StaleConnection,
    Unreachable,
    late,
    redirected,
    reported,
    status_error,
    time_limit,
)

CODECS: Mapping[str, Callable[[Any], Any]] = MappingProxyType(
    {
        "json-numpy": JSON_NUMPY.encode,
        "json-numpy-text": as_json_numpy_text,
        "lists": as_lists,
    }
)
"""Encodings of arrays, by the name that profiles use."""

CROSSING_S = 1.0
"""Longest time, s, in which the news of a closed connection crosses a request on its way."""

_GZIP = b"\x1f\x8b"

_SAME_METHOD = (307, 308)
"""Redirects that send a POST on as a POST."""


class HttpLink:
    """A connection to a server that answers POST requests, kept from one query to the next.

    A server may close a connection that nobody uses (uvicorn after 5 s), also while the next request is on
    its way to it. A kept connection that ends before anything is sent, or at once and before a byte of the
    answer, is stale and no lost answer, and the client opens another. The server may have read the request in
    between. As after every interruption, the query is asked again with the same content: a server that
    remembers more than the query says does not fit this protocol.
    """

    def __init__(self, address: Address, path: str, codec: str) -> None:
        self._first = self._target = replace(address, path=address.path or path)
        self._usual = path
        self._encode = CODECS[codec]
        self._connection: http.client.HTTPConnection | None = None
        self._has_answered = False

    def open(self) -> Any:
        """Connect; there is no greeting."""
        self._target = self._first
        self._open()
        self._kept = True  # the first query may come much later

    def ask(self, request: Any) -> Any:
        """Send a request and return the reply's value; redirects on the same host are followed."""
        body = to_json(request, self._encode)
        for _ in range(MOST_REDIRECTS):
            status, location, content = self._exchange(body)
            if status not in _SAME_METHOD:
                return _reply(content)
            self._target = redirected(self._target, location, status)
            self._open()
        raise Refused(f"sends from address to address, at last to {self._target}")

    def close(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    def _open(self) -> None:
        self.close()
        connection = http.client.HTTPConnection(self._target.host, self._target.port)
        if self._target.secure:
            connection.default_port = 443  # else the header Host names the port, which some balancers mind
        connection.sock = connect(self._target)
        connection.sock.settimeout(self._target.timeout_s)
        self._connection, self._kept = connection, False

    def _exchange(self, body: bytes) -> tuple[int, str | None, bytes]:
        """Return status, address of a redirect and body of the answer to a POST."""
        if self._connection is None:
            raise Unreachable("the connection is closed")
        if self._connection.sock is None:  # as the last answer announced
            self._open()
        elif self._kept and closed_by_peer(self._connection.sock):
            raise StaleConnection("the server has closed the connection, which nobody used")
        sock, timeout_s = self._connection.sock, self._target.timeout_s
        with (
            nullcontext() if self._has_answered else watched(sock, self._target, "http"),
            time_limit(sock, timeout_s),
        ):
            response, content = self._posted(self._connection, body)
        if response.status in _SAME_METHOD:
            return response.status, response.getheader("Location"), content
        if response.status != 200:
            location = f" to {response.getheader('Location')}" if response.getheader("Location") else ""
            reason = f"{response.reason}{location}"
            raise status_error(response.status, reason, self._target.path, content, self._usual)
        if response.will_close:
            self._connection.close()
        self._kept = self._has_answered = True
        return response.status, None, content

    def _posted(
        self, connection: http.client.HTTPConnection, body: bytes
    ) -> tuple[http.client.HTTPResponse, bytes]:
        token = server_token()
        headers = {
            "Content-Type": "application/json",
            "Accept": "application/json",
            **({} if token is None else {"Authorization": f"Bearer {token}"}),
        }
        asked_at = time.monotonic()
        try:
            connection.request("POST", self._target.path, body, headers)
            response = connection.getresponse()
            asked_at = -math.inf  # the answer has begun
            content = response.read(MOST_BYTES + 1)
            # Given a size, http.client does not complain of an answer that ends early.
            if response.length and len(content) <= MOST_BYTES:
                raise Unreachable(
                    f"the connection was lost after {counted(len(content), 'byte')} of the answer"
                )
            return response, unpacked(content, response.getheader("Content-Encoding"))
        except TimeoutError:
            raise late(self._target.timeout_s) from None
        except (OSError, http.client.HTTPException) as error:
            text = f"the connection was lost ({type(error).__name__}: {error})"
            if self._kept and isinstance(error, ENDS) and time.monotonic() - asked_at < CROSSING_S:
                raise StaleConnection(text) from error
            raise Unreachable(text) from error


class HttpProtocol(ServerProtocol):
    """JSON over HTTP."""

    scheme = "http"
    port = 80
    recognised = True
    profiles = "http"

    def link(self, opening: Opening) -> HttpLink:
        path = opening.profile.get("policy", "path", "/act")
        return HttpLink(opening.address, path, opening.choice("codec", CODECS))


def unpacked(content: bytes, encoding: str | None) -> bytes:
    """Return a body without its compression; gzip is recognised without its header as well."""
    word = (encoding or "identity").strip().lower()
    if word == "identity" and content[:2] != _GZIP:
        return content
    if word not in ("gzip", "x-gzip", "identity"):
        raise ServerError(f"an answer with Content-Encoding {shortened(word)}, but only gzip is read")
    stream = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        result = stream.decompress(content, MOST_BYTES + 1)
    except zlib.error as error:
        raise ServerError(f"an answer with Content-Encoding {word}, which is damaged ({error})") from error
    if not stream.eof and len(result) <= MOST_BYTES:
        raise ServerError(f"an answer with Content-Encoding {word}, which ends too early")
    return result


def _reply(content: bytes) -> Any:
    reply = from_json(content)
    if isinstance(reply, str):
        # OpenVLA-OFT answers a failure with the word "error" and status 200, and encodes some replies twice.
        if reply.strip()[:1] not in ("[", "{"):
            raise ServerError(f"the server answered {shortened(reply)}")
        reply = from_json(reply.encode(errors="surrogatepass"))
    if isinstance(reply, dict) and "error" in reply:
        raise reported(reply["error"])
    return reply
