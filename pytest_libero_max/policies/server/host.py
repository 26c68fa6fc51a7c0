"""The host behind a server's connections: the policy, when it is asked, and its memories."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.policies.cadence import played_at
from pytest_libero_max.policies.check import (
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
from pytest_libero_max.policies.server.batching import Batching, Desk, Waiting
from pytest_libero_max.policies.server.memories import Memories, Place
from pytest_libero_max.policies.server.metrics import Metrics
from pytest_libero_max.worlds.contract import Observation

Actions = NDArray[np.float64]


@dataclass(frozen=True)
class Question:
    """A query on its way to the policy.

    Attributes:
        item: Observation and query for the policy.
        place: Its place in an episode; None for a policy without memory.
        cadence: H and Q that the policy declares while it answers; None for its own.
        frames: For a policy that sees every step: what the world showed since the last query, with the step.
    """

    item: BatchItem
    place: Place | None = None
    cadence: Cadence | None = None
    frames: tuple[tuple[Observation, int], ...] = ()


@dataclass(frozen=True)
class Answer:
    """Answer to a question.

    Attributes:
        actions: (n, 7) with Q <= n <= H.
        batch: Number of queries that were answered together.
        memory: Name of what the policy remembers after it; None for a policy without memory.
    """

    actions: Actions
    batch: int = 1
    memory: str | None = None


class Host:
    """Answers the questions of many connections with one policy, in one thread.

    Each answer is a function of its question alone, so it does not matter who else asks; only the arithmetic
    of a batch may differ in its last digits.

    Args:
        policy: A checked policy that reads no simulator.
        revision: Identity of its weights or code, where its spec says nothing.
        batching: Number of queries that are answered together.
        metrics: Counters; None to count nothing.

    Raises:
        AdapterError: The policy reads the simulator, remembers what it cannot copy, or cannot answer several
            queries together.
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
        self._lock = threading.Lock()
        self._desk: Desk[Question, Answer] = Desk(batching, lambda: self._clients, self._answer)

    @property
    def spec(self) -> PolicySpec:
        """The policy's declaration, with the revision."""
        return PolicySpec(**{**self._policy.spec.to_dict(), "revision": self._revision})

    @property
    def remembers(self) -> bool:
        """True if the policy has a memory, so that every question needs a place."""
        return self._memories is not None

    @property
    def sees(self) -> bool:
        """True if the policy is shown every step, so that a question holds those since the last one."""
        return sees(self._policy)

    @property
    def batching(self) -> Batching:
        """Number of queries that are answered together."""
        return self._batching

    def open(self) -> AbstractContextManager[None]:
        """Answer until the block ends."""
        return self._desk.open()

    @contextmanager
    def client(self) -> Iterator[None]:
        """Count a client while the block lasts."""
        self._count(1)
        try:
            yield
        finally:
            self._count(-1)

    def ask(self, question: Question) -> Answer:
        """Wait for the answer.

        Raises:
            LiberoMaxError: The policy raised, its actions cannot be played, or the memory is not here.
        """
        return self._desk.ask(question)

    def refused(self, error: BaseException) -> None:
        """Count a request that got an error instead of an answer."""
        if self.metrics is not None:
            self.metrics.error(error)

    def _count(self, change: int) -> None:
        with self._lock:
            self._clients += change
            if self.metrics is not None:
                self.metrics.clients(self._clients)

    def _answer(self, batch: list[Waiting[Question, Answer]]) -> None:
        began = time.perf_counter()
        questions = [waiting.question for waiting in batch]
        outcomes = self._outcomes(questions)
        took = time.perf_counter() - began
        if self.metrics is not None:
            self.metrics.batch([began - waiting.since for waiting in batch], took)
        for waiting, outcome in zip(batch, outcomes, strict=True):
            if isinstance(outcome, Answer):
                waiting.answer.set_result(outcome)
            else:
                waiting.answer.set_exception(outcome)

    def _outcomes(self, questions: list[Question]) -> list[Answer | BaseException]:
        """Return the answers in the order of the questions; those of one cadence are found together."""
        found: dict[int, Answer | BaseException] = {}
        for cadence in dict.fromkeys(question.cadence for question in questions):
            places = [place for place, question in enumerate(questions) if question.cadence == cadence]
            group = [questions[place] for place in places]
            try:
                with played_at(self._policy, cadence):
                    own = self._together(group) if self._batching.size > 1 else [self._tried(group[0])]
            except AdapterError as error:
                own = [error] * len(group)
            found |= dict(zip(places, own, strict=True))
        return [found[place] for place in range(len(questions))]

    def _together(self, questions: list[Question]) -> list[Answer | BaseException]:
        """Return the answers to several questions; where one of them makes trouble, each is asked alone."""
        items = [question.item for question in questions]
        if self._batching.pad:
            items += items[:1] * (self._batching.size - len(items))
        try:
            actions = ask_together(self._policy, items)
        except BaseException as error:
            if len(questions) == 1:
                return [error]
            return [outcome for question in questions for outcome in self._together([question])]
        return [Answer(own, len(questions)) for own in actions[: len(questions)]]

    def _tried(self, question: Question) -> Answer | BaseException:
        try:
            return self._alone(question) if self._memories is None else self._remembering(question)
        except BaseException as error:
            self._episode = self._at = None
            return error

    def _alone(self, question: Question) -> Answer:
        item = question.item
        episode = (item.episode, question.cadence)
        if episode != self._episode:
            self._episode = None
            start(self._policy, item.episode)
            self._episode = episode
        return Answer(ask(self._policy, item.observation, item.query))

    def _remembering(self, question: Question) -> Answer:
        item, place, memories = question.item, question.place, self._memories
        assert place is not None
        assert memories is not None
        if place.at is None or (place.client, place.at) != self._at:
            memory = None if place.at is None else memories.find(place)
            start(self._policy, item.episode)
            if place.at is not None:
                restore_memory(self._policy, memory)
        self._at = None
        for observation, step in question.frames if self.sees else ():
            show(self._policy, observation, step)
        actions = ask(self._policy, item.observation, item.query)
        name = memories.add(place, copy_memory(self._policy))
        self._at = (place.client, name)
        return Answer(actions, memory=name)
