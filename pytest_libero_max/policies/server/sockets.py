"""The port at which a policy is served: WebSockets in two protocols, and a few pages over HTTP."""

from __future__ import annotations

import hmac
import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from types import MappingProxyType
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ServerError, install_extra
from pytest_libero_max.policies.clients.codecs import MOST_BYTES
from pytest_libero_max.policies.server import openpi, vla_eval
from pytest_libero_max.policies.server.host import Host

if TYPE_CHECKING:
    from websockets.http11 import Request, Response
    from websockets.sync.server import ServerConnection

    Talk = Callable[[ServerConnection, Host], None]

HEALTH = ("/health", "/healthz")
"""Paths at which GET answers everybody that the server is up."""

METRICS = "/metrics"

TALKS: Mapping[str, Talk] = MappingProxyType({"/": openpi.talk, "/vla-eval": vla_eval.talk})
"""Protocol at each path."""


@contextmanager
def serving(
    host: Host, name: str = "127.0.0.1", port: int = 8000, token: str | None = None
) -> Iterator[tuple[int, threading.Event]]:
    """Serve in threads until the block ends; yields the port, and an event that nobody sets, to wait for.

    A token is a secret that clients must send, as ``Authorization: Api-Key TOKEN`` or ``Bearer TOKEN``.
    """
    from websockets.sync.server import serve

    def talk(connection: ServerConnection) -> None:
        assert connection.request is not None
        with host.client():
            TALKS[_path(connection.request)](connection, host)

    try:
        server = serve(
            talk,
            name,
            port,
            process_request=lambda connection, request: _respond(connection, request, host, token),
            compression=None,
            max_size=MOST_BYTES,
            origins=[None],  # a page in somebody's browser is no client
            ping_interval=None,
            logger=_quiet(),
        )
    except OSError as error:
        raise ServerError(f"cannot listen at {name}:{port} ({error}). Choose another --port.") from error
    with server, host.open():
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server.socket.getsockname()[1], threading.Event()
        finally:
            server.shutdown()
            thread.join(5)


def _respond(
    connection: ServerConnection, request: Request, host: Host, token: str | None
) -> Response | None:
    """Return the page that a request gets; None for a WebSocket."""
    path = _path(request)
    if path in HEALTH:
        return connection.respond(HTTPStatus.OK, "OK\n")
    if token is not None and not _knows(request.headers.get_all("Authorization"), token):
        return connection.respond(HTTPStatus.UNAUTHORIZED, "This server asks for its token.\n")
    if path == METRICS:
        return _metrics(connection, host)
    if path not in TALKS:
        return connection.respond(
            HTTPStatus.NOT_FOUND, f"There is {', '.join((*TALKS, *HEALTH, METRICS))}.\n"
        )
    return None


def _metrics(connection: ServerConnection, host: Host) -> Response:
    if host.metrics is None:
        return connection.respond(
            HTTPStatus.NOT_IMPLEMENTED, f"Metrics need the extra: {install_extra('metrics')}\n"
        )
    text, kind = host.metrics.text()
    response = connection.respond(HTTPStatus.OK, text)
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = kind
    return response


def _knows(sent: list[str], token: str) -> bool:
    """Return True if one of the headers holds the token; takes the same time for every wrong one."""
    accepted = [f"{scheme} {token}".encode() for scheme in ("Api-Key", "Bearer")]
    return any(
        hmac.compare_digest(header.encode("utf-8", "surrogateescape"), known)
        for header in sent
        for known in accepted
    )


def _path(request: Request) -> str:
    return request.path.partition("?")[0]


def _quiet() -> logging.Logger:
    """Return a log for protocol errors of clients, shown from INFO on."""
    log = logging.getLogger("pytest_libero_max.servers.wire")
    log.setLevel(logging.CRITICAL)
    return log
