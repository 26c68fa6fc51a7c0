"""Common part of the protocols over WebSockets."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import Address, server_token
from pytest_libero_max.policies.clients.codecs import MOST_BYTES
from pytest_libero_max.policies.clients.transport import Unreachable, late, time_limit

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

OPEN_S = 20.0
"""Longest time to connect, s."""


class Socket:
    """A WebSocket without compression and without pings: a server that computes does not answer them."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._connection: ClientConnection | None = None
        self._until_closed = ExitStack()

    def open(self) -> None:
        """Connect.

        Raises:
            Unreachable: No server answers there.
            ServerError: The server does not speak WebSocket.
        """
        from websockets.exceptions import InvalidHandshake, InvalidURI
        from websockets.sync.client import connect

        self.close()
        token = server_token()
        try:
            self._connection = self._until_closed.enter_context(
                connect(
                    f"ws://{self._address.where}{self._address.path or '/'}",
                    additional_headers={} if token is None else {"Authorization": f"Api-Key {token}"},
                    compression=None,
                    max_size=MOST_BYTES,
                    ping_interval=None,
                    open_timeout=min(OPEN_S, self._address.timeout_s),
                    close_timeout=1.0,
                    proxy=None,
                )
            )
        except OSError as error:
            raise Unreachable(f"cannot be reached ({type(error).__name__}: {error})") from error
        except (InvalidHandshake, InvalidURI, EOFError) as error:
            raise Unreachable(f"does not open a WebSocket ({type(error).__name__}: {error})") from error

    def send(self, content: bytes) -> None:
        """Send a binary message.

        Raises:
            Unreachable: The connection was lost, or the server did not take it in time.
        """
        from websockets.exceptions import ConnectionClosed

        connection = self._open_connection()
        with time_limit(connection.socket, self._address.timeout_s):
            try:
                connection.send(content)
            except (ConnectionClosed, OSError) as error:
                raise Unreachable(f"the connection was lost ({error})") from error

    def receive(self) -> bytes | str:
        """Return the next message.

        Raises:
            Unreachable: The connection was lost, or nothing came in time.
            ServerError: The message is too large.
        """
        from websockets.exceptions import ConnectionClosed

        try:
            return self._open_connection().recv(timeout=self._address.timeout_s)
        except TimeoutError:
            raise late(self._address.timeout_s) from None
        except ConnectionClosed as error:
            if error.sent is not None and error.sent.code == 1009:
                raise ServerError(f"a message of more than {MOST_BYTES} bytes came") from error
            raise Unreachable(f"the connection was lost ({error})") from error
        except OSError as error:
            raise Unreachable(f"the connection was lost ({error})") from error

    def close(self) -> None:
        """Close the connection, if there is one."""
        self._connection = None
        self._until_closed.close()

    def _open_connection(self) -> ClientConnection:
        if self._connection is None:
            raise Unreachable("the connection is closed")
        return self._connection
