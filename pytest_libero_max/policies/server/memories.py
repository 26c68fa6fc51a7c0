"""Memories of a policy of each client's episode, between the queries of the others.

A memory never leaves the server. A client names the one that its query begins with, and gets the name of the
one after it; so it can ask a query again, and go back to any memory that it has kept.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.address import PATIENCE_S

MOST_KEPT = 64
"""Number of memories that a client may keep."""

MOST_CLIENTS = 256
"""Number of clients whose memories are kept; the one heard least recently is forgotten first."""

RECONNECT_S = 2 * PATIENCE_S
"""Time after the end of a connection in which its clients may ask again, s: twice as long as they try to."""

FORGOTTEN_AFTER_S = 3600.0
"""Time without queries after which a client is forgotten, s."""


@dataclass(frozen=True)
class Place:
    """Place of a query in an episode."""

    client: str
    """The client's name for itself."""
    at: str | None = None
    """Name of the memory that the query begins with; None for the first of an episode."""
    keep: tuple[str, ...] = ()
    """Names of further memories that the client may come back to."""

    @classmethod
    def read(cls, value: Any) -> Place:
        """Return the place that a request names."""
        value = value if isinstance(value, Mapping) else {}
        client, at, keep = value.get("client"), value.get("at"), value.get("keep", [])
        if (
            not (isinstance(client, str) and client)
            or not (at is None or isinstance(at, str))
            or not (isinstance(keep, list) and all(isinstance(name, str) for name in keep))
            or len(keep) > MOST_KEPT
        ):
            raise ServerError(
                "this policy has a memory, and a request must hold 'memory' with 'client', 'at' (None for "
                f"the first query of an episode) and 'keep' (at most {MOST_KEPT} names)"
            )
        return cls(client, at, tuple(keep))


@dataclass
class _Client:
    heard: float
    left: float = math.inf
    memories: dict[str, object] = field(default_factory=dict)


class Memories:
    """The memories of all clients. One thread uses it; others may say that clients left."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._clients: dict[str, _Client] = {}
        # A name of an earlier run of the server must not be taken for one of this run.
        self._run, self._count = secrets.token_hex(4), 0

    def __len__(self) -> int:
        return sum(len(client.memories) for client in self._clients.values())

    def find(self, place: Place) -> object:
        """Return the memory that a query begins with, which has a name."""
        client = self._clients.get(place.client)
        if client is None or place.at not in client.memories:
            raise ServerError(
                f"the memory {place.at!r} is not here: the server was started again, has not heard of this "
                f"client for {FORGOTTEN_AFTER_S:.0f} s, or {RECONNECT_S:.0f} s after its connection ended"
            )
        return client.memories[place.at]

    def leave(self, names: Iterable[str]) -> None:
        """Forget clients after a while, unless they ask again: their connection has ended."""
        now = self._clock()
        for name in names:
            client = self._clients.get(name)
            if client is not None:
                client.left = now

    def add(self, place: Place, memory: object) -> str:
        """Keep the memory after a query and those that the client still needs; return its name."""
        now = self._clock()
        self._clients = {
            name: client
            for name, client in self._clients.items()
            if name == place.client
            or (now - client.heard <= FORGOTTEN_AFTER_S and now - client.left <= RECONNECT_S)
        }
        if place.client not in self._clients and len(self._clients) >= MOST_CLIENTS:
            del self._clients[min(self._clients, key=lambda name: self._clients[name].heard)]
        client = self._clients.setdefault(place.client, _Client(now))
        client.heard, client.left = now, math.inf
        needed = {place.at, *place.keep}
        client.memories = {name: kept for name, kept in client.memories.items() if name in needed}
        self._count += 1
        name = f"{self._run}-{self._count}"
        client.memories[name] = memory
        return name
