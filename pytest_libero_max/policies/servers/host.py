"""Serving a policy: an adapter becomes a server that many workers share, in openpi's protocol.

The greeting holds the policy's spec. A request is the profile ``served``: the observation as the world
delivers it, the query and the episode. Queries are answered one after the other; the answer to each is a
function of what it holds alone, so it does not matter who else asks.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_libero_max.errors import AdapterError, LiberoMaxError, ServerError
from pytest_libero_max.policies.check import ask, remembers, start
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query
from pytest_libero_max.policies.servers.codecs import MOST_BYTES, OPENPI, pack, unpack

if TYPE_CHECKING:
    from websockets.http11 import Request, Response
    from websockets.sync.server import ServerConnection

LOG = logging.getLogger("pytest_libero_max.servers")

HEALTH = ("/health", "/healthz")
"""Paths at which GET says that the server is there."""

CLOSE_AFTER_ERROR = 1011


class Host:
    """Answers requests with a policy, one at a time.

    Args:
        policy: A checked policy without memory that reads no simulator.
        revision: What tells its weights or code from others, where its spec says nothing.

    Raises:
        AdapterError: It remembers, or reads the simulator.
    """

    def __init__(self, policy: Policy, revision: str) -> None:
        name = policy.spec.name
        if policy.spec.privileged:
            raise AdapterError(
                f"policy {name!r} reads the simulator (privileged), which a server does not have. Play it "
                "in process."
            )
        if remembers(policy):
            raise AdapterError(
                f"policy {name!r} has a memory (snapshot and restore), and a server would mix those of its "
                "clients. Play it in process."
            )
        self._policy = policy
        self._revision = policy.spec.revision or revision
        self._episode: Episode | None = None
        self._lock = threading.Lock()

    @property
    def greeting(self) -> dict[str, Any]:
        """The metadata that a client gets first."""
        return {"libero_max": 1, "spec": {**self._policy.spec.to_dict(), "revision": self._revision}}

    def answer(self, request: Any) -> dict[str, Any]:
        """The reply to a request.

        Raises:
            ServerError: The request is not that of the profile ``served``.
            LiberoMaxError: The policy raised, or its actions cannot be played.
        """
        observation, query, episode = _read(request)
        with self._lock:
            if episode != self._episode:
                self._episode = None
                start(self._policy, episode)
                self._episode = episode
            return {"actions": ask(self._policy, observation, query)}


@contextmanager
def serving(host: Host, name: str = "127.0.0.1", port: int = 8000) -> Iterator[tuple[int, threading.Event]]:
    """Serve in threads until the block ends.

    Args:
        host: What answers.
        name: Name or number of the interface.
        port: TCP port; 0 for any.

    Yields:
        The port, and an event that nobody sets: to wait for.

    Raises:
        ServerError: The port cannot be listened on.
    """
    from websockets.sync.server import serve

    try:
        server = serve(
            lambda connection: _talk(connection, host),
            name,
            port,
            process_request=_health,
            compression=None,
            max_size=MOST_BYTES,
            ping_interval=None,
            logger=_quiet(),
        )
    except OSError as error:
        raise ServerError(f"cannot listen at {name}:{port} ({error}). Choose another --port.") from error
    with server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server.socket.getsockname()[1], threading.Event()
        finally:
            server.shutdown()
            thread.join(5)


def declared_spec(greeting: Any) -> PolicySpec:
    """The spec that a server's greeting declares.

    Raises:
        ServerError: It declares none, or one that breaks a rule.
    """
    values = greeting.get("spec") if isinstance(greeting, Mapping) else None
    names = {item.name for item in fields(PolicySpec)}
    if not isinstance(values, dict) or not {"name", "horizon", "query_interval"} <= values.keys() <= names:
        raise ServerError("the greeting declares no spec: this is no server of `libero-max serve`")
    try:
        return PolicySpec(**values)
    except (AdapterError, TypeError) as error:
        raise ServerError(f"the greeting declares a spec that cannot be used: {error}") from error


def _talk(connection: ServerConnection, host: Host) -> None:
    from websockets.exceptions import ConnectionClosed

    with suppress(ConnectionClosed):
        connection.send(pack(host.greeting, OPENPI))
        for message in connection:
            try:
                reply = pack(host.answer(unpack(message, OPENPI)), OPENPI)
            except LiberoMaxError as error:
                LOG.warning("%s", error)
                connection.send(f"{type(error).__name__}: {error}".replace("\n", " "))
                connection.close(CLOSE_AFTER_ERROR)
                return
            connection.send(reply)


def _health(connection: ServerConnection, request: Request) -> Response | None:
    return connection.respond(HTTPStatus.OK, "OK\n") if request.path in HEALTH else None


def _quiet() -> logging.Logger:
    """A log for what clients do wrong on the wire, shown from INFO on."""
    log = logging.getLogger("pytest_libero_max.servers.wire")
    log.setLevel(logging.CRITICAL)
    return log


def _read(request: Any) -> tuple[dict[str, Any], Query, Episode]:
    try:
        observation, query, episode = (request[key] for key in ("observation", "query", "episode"))
        if not all(isinstance(value, np.ndarray) for value in observation.values()):
            raise TypeError("an observation holds arrays")
        return (
            dict(observation),
            Query(int(query["index"]), int(query["step"]), str(request["prompt"]), int(query["seed"])),
            Episode(
                str(episode["suite"]),
                int(episode["task_index"]),
                str(episode["instruction"]),
                int(episode["seed"]),
                int(episode["max_steps"]),
            ),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ServerError(
            f"a request that is not that of the profile 'served' ({type(error).__name__}: {error})"
        ) from error
