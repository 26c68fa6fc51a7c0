"""GR00T's protocol: ZeroMQ, one request and one reply, msgpack in one of three dialects.

N1.5 takes the observation itself as the data of a request and replies with a map; N1.6 and N1.7 take
``{"observation", "options"}`` and reply with two maps. N1.5 and N1.6 write arrays as NumPy files, N1.7 in the
msgpack-numpy dialect. The endpoint that stops a server is never called.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients.address import Address, server_token
from pytest_libero_max.policies.clients.codecs import (
    MOST_BYTES,
    MSGPACK_NUMPY,
    NPY,
    Dialect,
    pack,
    unpack,
)
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.transport import Unreachable, late, reported

DIALECTS: Mapping[str, Dialect] = MappingProxyType({"n1.5": NPY, "n1.6": NPY, "n1.7": MSGPACK_NUMPY})


class Gr00tLink:
    """A connection to a GR00T server.

    Args:
        address: Its address.
        dialect: A key of :data:`DIALECTS`.
    """

    def __init__(self, address: Address, dialect: str) -> None:
        self._address = address
        self._dialect = DIALECTS[dialect]
        self._bare = dialect == "n1.5"
        self._socket: Any = None

    def open(self) -> Any:
        """Connect and ping."""
        zmq = _zmq()
        self.close()
        self._socket = zmq.Context.instance().socket(zmq.REQ)
        timeout_ms = int(1000 * self._address.timeout_s)
        for option, value in (
            (zmq.LINGER, 0),
            (zmq.SNDTIMEO, timeout_ms),
            (zmq.RCVTIMEO, timeout_ms),
            (zmq.MAXMSGSIZE, MOST_BYTES),
        ):
            self._socket.setsockopt(option, value)
        try:
            self._socket.connect(f"tcp://{self._address.where}")
        except zmq.ZMQError as error:
            raise Unreachable(f"cannot be reached ({error})") from error
        return self._call({"endpoint": "ping"})

    def ask(self, request: Any) -> Any:
        """Send an observation and return the map of actions."""
        data = request if self._bare else {"observation": request, "options": None}
        reply = self._call({"endpoint": "get_action", "data": data})
        if not self._bare:
            if not isinstance(reply, list) or len(reply) != 2:
                raise ServerError(f"the reply is a {type(reply).__name__}, but must be a list of two maps")
            reply = reply[0]
        if not isinstance(reply, dict):
            raise ServerError(f"the actions are a {type(reply).__name__}, but must be a map")
        return reply

    def close(self) -> None:
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()  # after a time-out the socket could not be used again

    def _call(self, request: dict[str, Any]) -> Any:
        zmq = _zmq()
        if self._socket is None:
            raise Unreachable("the connection is closed")
        token = server_token()
        if token:
            request = {**request, "api_token": token}
        try:
            self._socket.send(pack(request, self._dialect))
            content = self._socket.recv()
        except zmq.Again:
            raise late(self._address.timeout_s) from None
        except zmq.ZMQError as error:
            raise Unreachable(f"the connection was lost ({error})") from error
        reply = unpack(content, self._dialect)
        if isinstance(reply, dict) and "error" in reply:
            raise reported(reply["error"])
        return reply


class Gr00tProtocol(ServerProtocol):
    """GR00T's protocol."""

    scheme = "gr00t"
    port = 5555

    def link(self, opening: Opening) -> Gr00tLink:
        return Gr00tLink(opening.address, opening.choice("dialect", DIALECTS))


def _zmq() -> Any:
    try:
        import zmq
    except ImportError:
        raise AdapterError(
            "gr00t:// needs pyzmq, which is not installed: `pip install 'pytest-libero-max[gr00t]'`."
        ) from None
    return zmq
