"""GR00T's protocol: ZeroMQ, one request and one reply, msgpack in one of three dialects.

N1.5 takes the observation itself as the data of a request and replies with a map; N1.6 and N1.7 take
``{"observation", "options"}`` and reply with two maps. N1.5 and N1.6 write arrays as NumPy files, N1.7 in the
msgpack-numpy dialect. The endpoint that stops a server is never called.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import closing
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import AdapterError, ServerError, install_extra
from pytest_libero_max.policies.clients.address import Address, server_token
from pytest_libero_max.policies.clients.codecs import (
    MOST_BYTES,
    MSGPACK_NUMPY,
    NPY,
    Dialect,
    pack,
    unpack,
)
from pytest_libero_max.policies.clients.connection import connect
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.transport import StaleConnection, Unreachable, late, reported

DIALECTS: Mapping[str, Dialect] = MappingProxyType({"n1.5": NPY, "n1.6": NPY, "n1.7": MSGPACK_NUMPY})

GREETING_S = 1.0
"""Time for the greeting of ZeroMQ, s: its own thread sends it at once, also where the policy computes."""

FIRST_BYTE = b"\xff"


class Gr00tLink:
    """A connection to a GR00T server."""

    def __init__(self, address: Address, dialect: str) -> None:
        self._address = address
        self.dialect = DIALECTS[dialect]
        self.message = b""
        self._bare = dialect == "n1.5"
        self._socket: Any = None
        self._losses: Any = None

    def open(self) -> Any:
        """Connect and ping.

        ZeroMQ itself never says that nothing is there: it tries to connect, in silence, for ever. So a
        connection of our own looks first, and finds which of the machine's addresses answers.
        """
        zmq = _zmq()
        self.close()
        host = _answering(self._address)
        self._socket = zmq.Context.instance().socket(zmq.REQ)
        timeout_ms = int(1000 * self._address.timeout_s)
        for option, value in (
            (zmq.LINGER, 0),
            (zmq.SNDTIMEO, timeout_ms),
            (zmq.RCVTIMEO, timeout_ms),
            (zmq.MAXMSGSIZE, MOST_BYTES),
            (zmq.IPV6, 1),
            (zmq.TCP_KEEPALIVE, 1),
        ):
            self._socket.setsockopt(option, value)
        try:
            self._losses = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
            self._socket.connect(f"tcp://{host}:{self._address.port}")
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
        connection, losses = self._socket, self._losses
        self._socket = self._losses = None
        if connection is not None:
            connection.disable_monitor()
            connection.close()  # after a time-out the socket could not be used again
        if losses is not None:
            losses.close()

    def _call(self, request: dict[str, Any]) -> Any:
        zmq = _zmq()
        if self._socket is None:
            raise Unreachable("the connection is closed")
        token = server_token()
        if token:
            request = {**request, "api_token": token}
        if self._losses.poll(0):
            raise StaleConnection("the server has closed the connection since its last answer")
        try:
            self._socket.send(pack(request, self.dialect))
            content = self._received()
        except zmq.Again:
            raise late(self._address.timeout_s) from None
        except zmq.ZMQError as error:
            raise Unreachable(f"the connection was lost ({error})") from error
        self.message, reply = content, unpack(content, self.dialect)
        if isinstance(reply, dict) and "error" in reply:
            raise reported(reply["error"])
        return reply

    def _received(self) -> bytes:
        """Return the answer; end where the connection ends, for ZeroMQ would wait for another to nowhere."""
        zmq = _zmq()
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(self._losses, zmq.POLLIN)
        ready = dict(poller.poll(int(1000 * self._address.timeout_s)))
        if self._losses in ready and not self._socket.poll(0):
            raise Unreachable("the connection was lost")
        content: bytes = self._socket.recv(zmq.NOBLOCK)
        return content


class Gr00tProtocol(ServerProtocol):
    """GR00T's protocol."""

    scheme = "gr00t"
    port = 5555
    recognised = True

    def link(self, opening: Opening) -> Gr00tLink:
        return Gr00tLink(opening.address, opening.choice("dialect", DIALECTS))


def _answering(address: Address) -> str:
    """Return the number of the machine that answers at an address, as ZeroMQ writes it."""
    with closing(connect(address)) as connection:
        host, _ = socket.getnameinfo(connection.getpeername(), socket.NI_NUMERICHOST | socket.NI_NUMERICSERV)
        connection.settimeout(GREETING_S)
        try:
            greeting = connection.recv(1)
        except TimeoutError:
            raise Unreachable(
                f"a connection opens, but ZeroMQ's greeting does not come within {GREETING_S:g} s"
            ) from None
        except OSError as error:
            raise Unreachable(f"the connection was lost ({error})") from error
    if greeting != FIRST_BYTE:
        what = (
            "was closed before ZeroMQ's greeting"
            if not greeting
            else "begins with another greeting than ZeroMQ's"
        )
        raise Unreachable(f"the connection {what}")
    return f"[{host}]" if ":" in host else host


def _zmq() -> Any:
    try:
        import zmq
    except ImportError:
        raise AdapterError(
            f"gr00t:// needs pyzmq, which is not installed: {install_extra('gr00t')}."
        ) from None
    return zmq
