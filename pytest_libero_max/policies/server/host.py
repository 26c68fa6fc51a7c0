"""The host behind a server's connections: the policy, when it is asked, and its memories."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

from pytest_libero_max.errors import AdapterError
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
from pytest_libero_max.policies.contract import BatchItem, Episode, Policy, PolicySpec
from pytest_libero_max.policies.server.batching import Batching, BatchQueue, Pending
from pytest_libero_max.policies.server.memories import Memories, Place
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

    Raises:
        AdapterError: The policy reads the simulator, has a memory that it cannot copy, or cannot answer
            several queries together.
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
        """Wait for the answer.

        Raises:
            LiberoMaxError: The policy raised, its actions cannot be played, or the memory is not here.
        """
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
