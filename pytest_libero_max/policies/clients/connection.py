"""Opens the connection to a policy server, alike for every protocol: the name, TCP, TLS.

An impossible connection fails within :data:`CONNECT_S`: no such name, no route, no listener, a firewall.
A server that accepts the connection and is silent is busy, and is given the time of an answer.
"""

from __future__ import annotations

import errno
import select
import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import Address, server_token
from pytest_libero_max.policies.clients.transport import NoConnection, Refused, Unreachable, late

if TYPE_CHECKING:
    from websockets.http11 import Response
    from websockets.sync.client import ClientConnection

CONNECT_S = 4.0
"""Longest time to find a name and to connect, s."""

_KEEP_ALIVE = (("TCP_KEEPIDLE", 30), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3))
"""When the system looks whether a silent peer is there, s; firewalls forget connections that say nothing."""

ENDS = (ConnectionError, ssl.SSLEOFError, ssl.SSLZeroReturnError)
"""Errors of a connection that the peer has closed; those of OpenSSL are no ``ConnectionError``."""

Resolved = tuple[int, int, int, str, Any]


def connect(address: Address) -> socket.socket:
    """Return an open connection to a server, encrypted where the address says so.

    Raises:
        NoConnection: Nothing accepts a connection there.
        Unreachable: The connection was lost.
        Refused: The server does not speak TLS, or its certificate is not trusted.
    """
    connection = _tcp(address)
    if not address.secure:
        return connection
    try:
        return _with_tls(connection, address)
    except BaseException:
        connection.close()
        raise


def look_up(host: str, port: int, family: int = socket.AF_UNSPEC) -> list[Resolved]:
    """Return the numbers of a host, as ``socket.getaddrinfo`` does, or fail in time, as it does not."""
    answers: SimpleQueue[list[Resolved] | OSError] = SimpleQueue()

    def ask() -> None:
        try:
            answers.put([*socket.getaddrinfo(host, port, family, socket.SOCK_STREAM)])
        except (OSError, UnicodeError) as error:
            answers.put(error if isinstance(error, OSError) else OSError(str(error)))

    # The system's own resolver may try for half a minute, and cannot be interrupted.
    Thread(target=ask, name="libero-max-name", daemon=True).start()
    try:
        answer = answers.get(timeout=CONNECT_S)
    except Empty:
        raise NoConnection(
            f"cannot be reached: the name {host!r} was not found within {CONNECT_S:g} s"
        ) from None
    if isinstance(answer, OSError):
        raise NoConnection(f"cannot be reached: no machine is called {host!r} ({_words(answer)})") from answer
    return answer


def closed_by_peer(connection: socket.socket) -> bool:
    """Return True if the peer has closed a connection on which nothing is expected."""
    try:
        readable = select.poll()
        readable.register(connection, select.POLLIN)
        if not readable.poll(0):
            return False
        return not isinstance(connection, ssl.SSLSocket) or _ended(connection)
    except (OSError, ValueError):  # closed on this side
        return True


def _ended(connection: ssl.SSLSocket) -> bool:
    """Return True unless all that came is TLS's own.

    Since TLS 1.3 a server sends tickets for later sessions after the handshake: a connection that is readable
    need not be at its end. To read is the only way to tell, and nothing of the peer's is expected.
    """
    timeout_s = connection.gettimeout()
    connection.setblocking(False)
    try:
        connection.recv(1)
    except ssl.SSLWantReadError:
        return False
    finally:
        connection.settimeout(timeout_s)
    return True


def _tcp(address: Address) -> socket.socket:
    until = time.monotonic() + CONNECT_S
    hosts = look_up(address.host, address.port)
    failure: OSError | None = None
    for family, target, limit_s in _in_time(hosts, until):
        connection = socket.socket(family, socket.SOCK_STREAM)
        try:
            connection.settimeout(limit_s)
            connection.connect(target)
        except OSError as error:
            connection.close()
            failure = error
        else:
            connection.settimeout(None)
            _tune(connection)
            return connection
    assert failure is not None
    raise NoConnection(f"cannot be reached: {_reason(address, failure)}") from failure


def _in_time(hosts: list[Resolved], until: float) -> Iterator[tuple[int, Any, float]]:
    """Family, number and time of each address of a host; those that are left share the time that is left."""
    for place, (family, _, _, _, target) in enumerate(hosts):
        yield family, target, max(until - time.monotonic(), 0.1) / (len(hosts) - place)


def _tune(connection: socket.socket) -> None:
    # Else the end of a request may wait until the server has acknowledged its beginning (Nagle).
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in _KEEP_ALIVE:
        with suppress(AttributeError, OSError):  # not on every system
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


def _reason(address: Address, error: OSError) -> str:
    if isinstance(error, ConnectionRefusedError):
        return f"nothing listens at {address.where} (connection refused)"
    if isinstance(error, TimeoutError):
        return (
            f"{address.where} did not accept a connection within {CONNECT_S:g} s: a firewall, a machine that "
            "is off, or one with too many connections"
        )
    if error.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EADDRNOTAVAIL):
        return f"no way leads to {address.where} ({_words(error)})"
    return f"{address.where}: {_words(error)}"


def _words(error: OSError) -> str:
    return error.strerror or str(error)


def _with_tls(connection: socket.socket, address: Address) -> ssl.SSLSocket:
    connection.settimeout(address.timeout_s)
    try:
        secured = ssl.create_default_context().wrap_socket(connection, server_hostname=address.host)
    except ssl.SSLCertVerificationError as error:
        raise Refused(
            f"its certificate is not trusted ({error.verify_message}). Let SSL_CERT_FILE=FILE name the "
            "certificate of your own authority"
        ) from error
    except TimeoutError:
        raise late(address.timeout_s) from None
    except ssl.SSLEOFError as error:
        raise Unreachable("the connection was closed before TLS began") from error
    except ssl.SSLError as error:
        plain = address.over(address.protocol, secure=False)
        raise Refused(
            f"does not speak TLS ({error.reason or error}). Without TLS its address is {plain}"
        ) from error
    except OSError as error:
        raise Unreachable(f"the connection was lost ({_words(error)})") from error
    secured.settimeout(None)
    return secured


def speaks_tls(address: Address, limit_s: float) -> bool:
    """Return True if a server answers as one that speaks TLS; nothing is sent to it but the begin of that."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with _tcp(address) as connection:
            connection.settimeout(limit_s)
            context.wrap_socket(connection, server_hostname=address.host).close()
    except (ServerError, OSError):
        return False
    return True


def open_websocket(
    connection: socket.socket, address: Address, timeout_s: float, most_bytes: int
) -> ClientConnection:
    """Return a WebSocket over an open connection, without compression and without pings.

    A server that computes does not answer pings. The errors of the library are passed on.
    """
    from websockets.sync.client import connect as connect_websocket

    token = server_token()
    return connect_websocket(
        f"ws://{address.where}{address.path or '/'}",  # over TLS as well, which is spoken already
        sock=connection,
        additional_headers={} if token is None else {"Authorization": f"Api-Key {token}"},
        compression=None,
        max_size=most_bytes,
        ping_interval=None,
        open_timeout=timeout_s,
        close_timeout=1.0,
        proxy=None,
    )


def answer_in_place(error: BaseException) -> Response | None:
    """Return the answer of HTTP that came in the place of a WebSocket; None where an error has none."""
    from websockets.exceptions import InvalidStatus

    # A redirect is not followed over a connection that is given, and another error says so.
    for status in (error, error.__cause__, error.__context__):
        if isinstance(status, InvalidStatus):
            return status.response
    return None
