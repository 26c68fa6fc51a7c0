"""The host behind a server's connections: the policy, when it is asked, and its memories.

A memory never leaves the server. A client names the one that its query begins with, and gets the name of the
one after it; so it can ask a query again, and go back to any memory that it has kept.
"""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.policies.cadence import played_at
from pytest_libero_max.policies.check import (
    Actions,
    ask,
    ask_together,
    batches,
    copy_memory,
    memory_of,
    remembers,
    restore_memory,
    sees,
    show,
    start,
)
from pytest_libero_max.policies.clients.address import PATIENCE_S
from pytest_libero_max.policies.contract import BatchItem, Episode, Policy, PolicySpec
from pytest_libero_max.policies.server.batching import Batching, BatchQueue, Pending
from pytest_libero_max.policies.server.metrics import Metrics
from pytest_libero_max.worlds.contract import Observation


@dataclass(frozen=True)
class InferenceRequest:
    """A query on its way to the policy."""

    item: BatchItem
    place: Place | None = None
    """Its place in an episode; None for a policy without memory."""
    cadence: Cadence | None = None
    frames: tuple[tuple[Observation, int], ...] = ()
    """For a policy that sees every step: observations since the last query, each with its step."""


@dataclass(frozen=True)
class InferenceResult:
    """Answer to a request."""

    actions: Actions
    batch: int = 1
    memory: str | None = None
    """Name of the policy's memory after it; None for a policy without memory."""


class Host:
    """Answers the requests of many connections with one policy, in one thread.

    Each answer is a function of its request alone and does not depend on other clients; only the arithmetic
    of a batch may differ in its last digits.
    """

    def __init__(
        self,
        policy: Policy,
        revision: str,
        batching: Batching | None = None,
        metrics: Metrics | None = None,
    ) -> None:
        batching = Batching() if batching is None else batching
        name = policy.spec.name
        if policy.spec.privileged:
            raise AdapterError(
                f"policy {name!r} reads the simulator (privileged), which a server does not have. Play it "
                "in process."
            )
        if memory_of(policy) in ("queries", "frames"):
            raise AdapterError(
                f"policy {name!r} remembers what it was shown, and cannot copy it, so a server cannot keep "
                "it for each client. Give it snapshot() and restore(memory), or play it in process."
            )
        if batching.size > 1 and remembers(policy):
            raise AdapterError(
                f"policy {name!r} has a memory (snapshot and restore), so its queries are answered one by "
                "one. Leave --max-batch out."
            )
        if batching.size > 1 and not batches(policy):
            raise AdapterError(
                f"policy {name!r} has no predict_batch(items), so --max-batch={batching.size} is not "
                "possible. Add the method, or leave the option out."
            )
        self.metrics = metrics
        self._policy = policy
        self._revision = policy.spec.revision or revision
        self._batching = batching
        self._memories = Memories() if remembers(policy) else None
        self._episode: tuple[Episode, Cadence | None] | None = None
        self._at: tuple[str, str | None] | None = None
        self._clients = 0
        self._connection = threading.local()  # each has a thread of its own
        self._lock = threading.Lock()
        self._queue: BatchQueue[InferenceRequest, InferenceResult] = BatchQueue(
            batching, lambda: self._clients, self._answer
        )

    @property
    def spec(self) -> PolicySpec:
        """The policy's declaration, with the revision."""
        return replace(self._policy.spec, revision=self._revision)

    @property
    def remembers(self) -> bool:
        """True if the policy has a memory, so that every request needs a place."""
        return self._memories is not None

    @property
    def sees(self) -> bool:
        """True if the policy is shown every step, so that a request holds those since the last one."""
        return sees(self._policy)

    @property
    def batching(self) -> Batching:
        """Number of queries that are answered together."""
        return self._batching

    def open(self) -> AbstractContextManager[None]:
        """Answer until the block ends."""
        return self._queue.open()

    @contextmanager
    def client(self) -> Iterator[None]:
        """Count a connection while the block lasts; what it asks is asked by this thread.

        Memories of its clients are kept for a while, for they may connect again.
        """
        self._count(1)
        named: set[str] = set()
        self._connection.clients = named
        try:
            yield
        finally:
            self._count(-1)
            if self._memories is not None:
                self._memories.leave(named)

    def ask(self, request: InferenceRequest) -> InferenceResult:
        """Wait for the answer."""
        if request.place is not None and hasattr(self._connection, "clients"):
            self._connection.clients.add(request.place.client)
        return self._queue.ask(request)

    def refused(self, error: BaseException) -> None:
        """Count a request that got an error instead of an answer."""
        if self.metrics is not None:
            self.metrics.error(error)

    def _count(self, change: int) -> None:
        with self._lock:
            self._clients += change
            if self.metrics is not None:
                self.metrics.clients(self._clients)

    def _answer(self, batch: list[Pending[InferenceRequest, InferenceResult]]) -> None:
        began = time.perf_counter()
        requests = [pending.request for pending in batch]
        outcomes = self._outcomes(requests)
        took = time.perf_counter() - began
        if self.metrics is not None:
            self.metrics.batch([began - pending.since for pending in batch], took)
        for pending, outcome in zip(batch, outcomes, strict=True):
            if isinstance(outcome, InferenceResult):
                pending.result.set_result(outcome)
            else:
                pending.result.set_exception(outcome)

    def _outcomes(self, requests: list[InferenceRequest]) -> list[InferenceResult | BaseException]:
        """Return the answers in the order of the requests; those of one cadence are found together."""
        outcomes: dict[int, InferenceResult | BaseException] = {}
        for cadence in dict.fromkeys(request.cadence for request in requests):
            places = [place for place, request in enumerate(requests) if request.cadence == cadence]
            group = [requests[place] for place in places]
            try:
                with played_at(self._policy, cadence):
                    own = self._together(group) if self._batching.size > 1 else [self._tried(group[0])]
            except AdapterError as error:
                own = [error] * len(group)
            outcomes |= dict(zip(places, own, strict=True))
        return [outcomes[place] for place in range(len(requests))]

    def _together(self, requests: list[InferenceRequest]) -> list[InferenceResult | BaseException]:
        """Return the answers to several requests; where one of them makes trouble, each is asked alone."""
        items = [request.item for request in requests]
        if self._batching.pad:
            items += items[:1] * (self._batching.size - len(items))
        try:
            actions = ask_together(self._policy, items)
        except BaseException as error:
            if len(requests) == 1:
                return [error]
            return [outcome for request in requests for outcome in self._together([request])]
        return [InferenceResult(own, len(requests)) for own in actions[: len(requests)]]

    def _tried(self, request: InferenceRequest) -> InferenceResult | BaseException:
        try:
            return self._alone(request) if self._memories is None else self._remembering(request)
        except BaseException as error:
            self._episode = self._at = None
            return error

    def _alone(self, request: InferenceRequest) -> InferenceResult:
        item = request.item
        episode = (item.episode, request.cadence)
        if episode != self._episode:
            self._episode = None
            start(self._policy, item.episode)
            self._episode = episode
        return InferenceResult(ask(self._policy, item.observation, item.query))

    def _remembering(self, request: InferenceRequest) -> InferenceResult:
        item, place, memories = request.item, request.place, self._memories
        assert place is not None
        assert memories is not None
        if place.at is None or (place.client, place.at) != self._at:
            memory = None if place.at is None else memories.find(place)
            start(self._policy, item.episode)
            if place.at is not None:
                restore_memory(self._policy, memory)
        self._at = None
        for observation, step in request.frames if self.sees else ():
            show(self._policy, observation, step)
        actions = ask(self._policy, item.observation, item.query)
        name = memories.add(place, copy_memory(self._policy))
        self._at = (place.client, name)
        return InferenceResult(actions, memory=name)


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
