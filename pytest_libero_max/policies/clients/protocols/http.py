"""HTTP: one POST of a JSON document for each query, answered with another.

Arrays are written in one of three ways: json-numpy maps, the same as strings, and nested lists with images as
base64 files.
"""

from __future__ import annotations

import http.client
import ssl
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.codecs import (
    JSON_NUMPY,
    MOST_BYTES,
    as_json_numpy_text,
    as_lists,
    from_json,
    shortened,
    to_json,
)
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.transport import Unreachable, late, reported, time_limit

CODECS: Mapping[str, Callable[[Any], Any]] = MappingProxyType(
    {
        "json-numpy": JSON_NUMPY.encode,
        "json-numpy-text": as_json_numpy_text,
        "lists": as_lists,
    }
)
"""Encodings of arrays, by the name that profiles use."""


class HttpLink:
    """A connection to a server that answers POST requests.

    Args:
        address: Its address.
        path: Of the URL, where the address has none.
        codec: A key of :data:`CODECS`.
    """

    def __init__(self, address: Address, path: str, codec: str) -> None:
        self._address = address
        self._path = address.path or path
        self._encode = CODECS[codec]
        self._connection: http.client.HTTPConnection | None = None

    def open(self) -> Any:
        """Connect; there is no greeting."""
        self.close()
        timeout = self._address.timeout_s
        host, port = self._address.host, self._address.port
        if self._address.scheme == "https":
            context = ssl.create_default_context()
            self._connection = http.client.HTTPSConnection(host, port, timeout=timeout, context=context)
        else:
            self._connection = http.client.HTTPConnection(host, port, timeout=timeout)
        try:
            self._connection.connect()
        except OSError as error:
            raise Unreachable(f"cannot be reached ({type(error).__name__}: {error})") from error

    def ask(self, request: Any) -> Any:
        """Send a request and return the reply's value."""
        if self._connection is None:
            raise Unreachable("the connection is closed")
        if self._connection.sock is None:  # the last answer has closed it
            self.open()
        with time_limit(self._connection.sock, self._address.timeout_s):
            return self._asked(request)

    def _asked(self, request: Any) -> Any:
        assert self._connection is not None
        headers = {"Content-Type": "application/json", "Accept": "application/json"}
        try:
            self._connection.request("POST", self._path, to_json(request, self._encode), headers)
            response = self._connection.getresponse()
            content = response.read(MOST_BYTES + 1)
        except TimeoutError:
            raise late(self._address.timeout_s) from None
        except (OSError, http.client.HTTPException) as error:
            raise Unreachable(f"the connection was lost ({type(error).__name__}: {error})") from error
        if response.status in (502, 503, 504):
            raise Unreachable(f"HTTP status {response.status} {response.reason}")
        if response.status != 200:
            text = shortened(content.decode("utf-8", "replace"))
            raise ServerError(f"HTTP status {response.status} {response.reason} for {self._path}: {text}")
        if response.will_close:
            # The next request opens the connection again.
            self._connection.close()
        return _reply(content)

    def close(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()


class HttpProtocol(ServerProtocol):
    """JSON over HTTP."""

    scheme = "http"
    port = 80
    profiles = "http"

    def link(self, opening: Opening) -> HttpLink:
        path = opening.profile.get("policy", "path", "/act")
        return HttpLink(opening.address, path, opening.choice("codec", CODECS))


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
