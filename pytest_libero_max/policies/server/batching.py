"""Queue of queries for the policy: one thread answers them, several together where asked for."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from pytest_libero_max.errors import AdapterError, ServerError

Request = TypeVar("Request")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Batching:
    """Number of queries that are answered together."""

    size: int = 1
    """Largest number. 1: each query is answered alone."""
    wait_s: float = 0.005
    """Longest time that the first query of a batch waits for others, s. It does not wait when every client
    has asked."""
    pad: bool = False
    """True if a smaller batch is filled up with copies of its first query, so that the arithmetic always has
    the same shape."""

    def __post_init__(self) -> None:
        if self.size < 1:
            raise AdapterError.seen("max_batch", self.size, ", but must be at least 1.")
        if not 0.0 <= self.wait_s <= 60.0:
            raise AdapterError.seen("max_wait_ms", 1000.0 * self.wait_s, ", but must be from 0 to 60000.")
        if self.pad and self.size == 1:
            raise AdapterError("pad_batch pads to the full batch, but max_batch is 1. Raise max_batch.")


@dataclass(frozen=True)
class Pending(Generic[Request, Result]):
    """A request that waits for its result."""

    request: Request
    result: Future[Result] = field(default_factory=Future)
    since: float = field(default_factory=time.perf_counter)
    """Time of arrival, by ``time.perf_counter``."""


class BatchQueue(Generic[Request, Result]):
    """Takes requests from many threads, and has them answered in one."""

    def __init__(
        self,
        batching: Batching,
        present: Callable[[], int],
        answer: Callable[[list[Pending[Request, Result]]], None],
    ) -> None:
        self._batching = batching
        self._present = present
        self._answer = answer
        self._queue: queue.SimpleQueue[Pending[Request, Result] | None] = queue.SimpleQueue()
        self._closed = threading.Event()

    def ask(self, request: Request) -> Result:
        """Wait for the answer to a request."""
        pending: Pending[Request, Result] = Pending(request)
        self._queue.put(pending)
        if self._closed.is_set():
            self._refuse()
        return pending.result.result()

    @contextmanager
    def open(self) -> Iterator[None]:
        """Answer requests until the block ends; those that wait then are refused."""
        thread = threading.Thread(target=self._work, name="policy", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._closed.set()
            self._queue.put(None)
            thread.join(5)
            self._refuse()

    def _work(self) -> None:
        while batch := self._batch():
            try:
                self._answer(batch)
            except BaseException as error:  # a mistake here must not leave clients waiting
                for pending in batch:
                    if not pending.result.done():
                        pending.result.set_exception(error)

    def _batch(self) -> list[Pending[Request, Result]]:
        """Return the next requests to be answered together; none at the end."""
        first = self._queue.get()
        if first is None or self._closed.is_set():
            return self._ended(first)
        batch = [first]
        until = first.since + self._batching.wait_s
        while len(batch) < self._batching.size:
            try:
                if len(batch) >= self._present():
                    following = self._queue.get_nowait()
                else:
                    following = self._queue.get(timeout=max(0.0, until - time.perf_counter()))
            except queue.Empty:
                break
            if following is None:
                self._queue.put(None)
                break
            batch.append(following)
        return batch

    def _ended(self, first: Pending[Request, Result] | None) -> list[Pending[Request, Result]]:
        if first is not None:
            self._queue.put(first)
        return []

    def _refuse(self) -> None:
        while True:
            try:
                pending = self._queue.get_nowait()
            except queue.Empty:
                return
            if pending is not None:
                pending.result.set_exception(ServerError("the server is being stopped"))
