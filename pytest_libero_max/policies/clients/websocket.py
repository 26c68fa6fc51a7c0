"""Common part of the protocols over WebSockets."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from threading import Event
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.codecs import MOST_BYTES
from pytest_libero_max.policies.clients.connection import answer_in_place, connect, open_websocket
from pytest_libero_max.policies.clients.recognition import watched
from pytest_libero_max.policies.clients.transport import (
    MOST_REDIRECTS,
    Refused,
    StaleConnection,
    Unreachable,
    late,
    redirected,
    status_error,
    time_limit,
)

if TYPE_CHECKING:
    from websockets.http11 import Response
    from websockets.sync.client import ClientConnection


class Socket:
    """A WebSocket to a policy server."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._connection: ClientConnection | None = None
        self._until_closed = ExitStack()

    def open(self) -> Any:
        """Connect; a redirect on the same host is followed."""
        self.close()
        target = self._address
        for _ in range(MOST_REDIRECTS):
            response = self._opened(target)
            if response is None:
                return
            status, location = response.status_code, response.headers.get("Location")
            if not (300 <= status < 400 and location):
                raise status_error(status, response.reason_phrase, target.path, bytes(response.body or b""))
            target = redirected(target, location, status)
        raise Refused(f"sends from address to address, at last to {target}")

    def send(self, content: bytes) -> None:
        """Send a binary message."""
        from websockets.exceptions import ConnectionClosed

        connection = self._open_connection()
        with time_limit(connection.socket, self._address.timeout_s):
            try:
                connection.send(content)
            except (ConnectionClosed, OSError) as error:
                # Not even the whole request has arrived.
                raise StaleConnection(f"the connection was lost ({error})") from error

    def receive(self, awaited: str = "") -> bytes | str:
        """Return the next message; while an awaited greeting is missing, another protocol is recognised."""
        if not awaited:
            return self._received("no answer came")
        opened, protocol = self._open_connection().socket, self._address.protocol
        with watched(opened, self._address, protocol, f"a WebSocket opened, and {awaited} has not come yet"):
            return self._received(f"a WebSocket opened, but {awaited} did not come")

    def ping(self) -> Event:
        """Send a ping, also while an answer is awaited; return the event of its answer."""
        return self._open_connection().ping()

    def close(self) -> None:
        """Close the connection, if there is one."""
        self._connection = None
        self._until_closed.close()

    def _received(self, silence: str) -> bytes | str:
        from websockets.exceptions import ConnectionClosed

        try:
            return self._open_connection().recv(timeout=self._address.timeout_s)
        except TimeoutError:
            raise late(self._address.timeout_s, silence) from None
        except ConnectionClosed as error:
            if error.sent is not None and error.sent.code == 1009:
                raise ServerError(f"a message of more than {MOST_BYTES} bytes came") from error
            raise Unreachable(f"the connection was lost ({error})") from error
        except OSError as error:
            raise Unreachable(f"the connection was lost ({error})") from error

    def _opened(self, target: Address) -> Response | None:
        """Open a WebSocket; return the answer in its place where there is one."""
        connection = connect(target)
        try:
            with watched(connection, target, target.protocol):
                return self._shake_hands(connection, target)
        except BaseException:
            connection.close()
            raise

    def _shake_hands(self, connection: socket.socket, target: Address) -> Response | None:
        from websockets.exceptions import ConnectionClosed, WebSocketException

        try:
            websocket = open_websocket(connection, target, target.timeout_s, MOST_BYTES)
            self._connection = self._until_closed.enter_context(websocket)
        except TimeoutError:
            raise late(target.timeout_s) from None
        except (OSError, EOFError, ConnectionClosed) as error:
            raise Unreachable(f"the connection was lost ({type(error).__name__}: {error})") from error
        except (WebSocketException, ValueError) as error:
            answer = answer_in_place(error)
            if answer is None:
                raise Unreachable(f"does not open a WebSocket ({type(error).__name__}: {error})") from error
            return answer
        return None

    def _open_connection(self) -> ClientConnection:
        if self._connection is None:
            raise Unreachable("the connection is closed")
        return self._connection
