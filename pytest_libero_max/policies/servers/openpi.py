"""openpi's protocol: WebSocket, one frame of metadata, then one msgpack map each way.

An error of the server comes as text, before it closes the connection. There is no message for a reset.
"""

from __future__ import annotations

from typing import Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.servers.address import Address
from pytest_libero_max.policies.servers.codecs import OPENPI, pack, shortened, unpack
from pytest_libero_max.policies.servers.websocket import Socket


class OpenpiLink:
    """A connection to a server that speaks openpi's protocol.

    Args:
        address: Where it is.
    """

    def __init__(self, address: Address) -> None:
        self._socket = Socket(address)

    def open(self) -> Any:
        """Connect; the metadata."""
        self._socket.open()
        return self._read()

    def ask(self, request: Any) -> Any:
        """Send the map of an observation; the reply's map."""
        self._socket.send(pack(request, OPENPI))
        return self._read()

    def close(self) -> None:
        self._socket.close()

    def _read(self) -> dict[Any, Any]:
        message = self._socket.receive()
        if isinstance(message, str):
            lines = message.strip().splitlines()
            raise ServerError(f"the server reports an error: {shortened(lines[-1] if lines else '')}")
        reply = unpack(message, OPENPI)
        if not isinstance(reply, dict):
            raise ServerError(f"a message is a {type(reply).__name__}, but openpi's are maps")
        return reply
