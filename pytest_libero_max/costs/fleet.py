"""How long a fleet of workers and policy servers plays pairs: their queues, event by event.

A worker takes the next pair when it is free. With policy servers it computes, asks, waits in one queue for
a free server, computes on, and so on; the queries of a pair are spread evenly over its own computation.
The process that owns the run takes in one record after another, and no worker waits for it.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil

from pytest_libero_max.costs.model import Cost

MOST_CALLS = 1_500_000
"""With servers so many queries are played event by event. The pairs behind them keep the pace of those."""


@dataclass(frozen=True)
class Fleet:
    """What plays.

    Attributes:
        workers: Processes that play pairs, each on a processor core of its own.
        servers: Policy servers, which answer one batch at a time; 0: each worker has the policy in it.
        query_s: What a query takes, alone; None: what it took in the run that was measured.
        batch: Queries that a server answers together.
        batch_s: What a full batch takes; None: as much as one query. What is between is interpolated.
        record_s: What the process that owns the run needs for a pair: to receive, check and write it.
        start_s: What passes before a worker begins its first pair.
    """

    workers: int
    servers: int = 0
    query_s: float | None = None
    batch: int = 1
    batch_s: float | None = None
    record_s: float = 0.0
    start_s: float = 0.0

    def answer_s(self, queries: int) -> float:
        """What so many queries take that a server answers together."""
        alone = self.query_s or 0.0
        if self.batch_s is None or self.batch == 1:
            return alone
        return alone + (self.batch_s - alone) * (queries - 1) / (self.batch - 1)


@dataclass(frozen=True)
class Played:
    """How a fleet played.

    Attributes:
        seconds: From the start of the workers until the last record is written.
        computing: Share of the workers' time in which they played, the policy in them included.
        waiting: Share of it in which they waited for a policy server or its answer.
        serving: Share of the servers' time in which they answered.
        writing: Share of the time in which the process that owns the run took in records.
        batch: Mean number of queries that were answered together.
        simulated: How many pairs were played event by event; the others keep their pace.
    """

    seconds: float
    computing: float
    waiting: float
    serving: float
    writing: float
    batch: float
    simulated: int

    @property
    def bottleneck(self) -> str:
        """What is busiest: ``workers``, ``policy servers`` or ``controller``."""
        shares = {"workers": self.computing, "policy servers": self.serving, "controller": self.writing}
        return max(shares, key=lambda name: shares[name])


def play(costs: Sequence[Cost], fleet: Fleet) -> Played:
    """Play pairs in their order.

    Args:
        costs: What each pair costs; at least one.
        fleet: What plays them.
    """
    return _with_servers(costs, fleet) if fleet.servers else _without_servers(costs, fleet)


def _without_servers(costs: Sequence[Cost], fleet: Fleet) -> Played:
    free = [fleet.start_s] * fleet.workers
    ends, busy = [], 0.0
    for cost in costs:
        policy_s = cost.policy_s if fleet.query_s is None else cost.calls * fleet.query_s
        end = heapq.heappop(free) + cost.worker_s + policy_s
        busy += cost.worker_s + policy_s
        heapq.heappush(free, end)
        ends.append(end)
    seconds = _written(ends, fleet.record_s)
    return Played(
        seconds=seconds,
        computing=busy / (seconds * fleet.workers),
        waiting=0.0,
        serving=0.0,
        writing=len(costs) * fleet.record_s / seconds,
        batch=1.0,
        simulated=len(costs),
    )


def _written(ends: Sequence[float], record_s: float) -> float:
    """When the last of some records is written that are written one after the other."""
    written = 0.0
    for end in sorted(ends):
        written = max(written, end) + record_s
    return written


def _with_servers(costs: Sequence[Cost], fleet: Fleet) -> Played:
    some = costs[:: max(ceil(sum(cost.calls for cost in costs) / MOST_CALLS), 1)]
    queue = _Queue(some, fleet)
    queue.run()
    seconds = _written(queue.ends, fleet.record_s)
    # The others are played while all workers are busy, at the pace of these while all workers were.
    others = len(costs) - len(some)
    pace_s = max((queue.last_begin - fleet.start_s) / len(some), fleet.record_s)
    time_of_workers = seconds * fleet.workers
    return Played(
        seconds=seconds + others * pace_s,
        computing=sum(cost.worker_s for cost in some) / time_of_workers,
        waiting=queue.waiting_s / time_of_workers,
        serving=queue.serving_s / (seconds * fleet.servers),
        writing=len(some) * fleet.record_s / seconds,
        batch=queue.answered / max(queue.batches, 1),
        simulated=len(some),
    )


class _Queue:
    """Workers that compute and ask, and the servers they ask.

    Attributes:
        ends: When each pair ended.
        last_begin: When the last pair was begun.
        waiting_s: How long workers waited, summed over them.
        serving_s: How long servers answered, summed over them.
        answered: Queries.
        batches: Batches in which they were answered.
    """

    def __init__(self, costs: Sequence[Cost], fleet: Fleet) -> None:
        self.ends: list[float] = []
        self.last_begin = fleet.start_s
        self.waiting_s = self.serving_s = 0.0
        self.answered = self.batches = 0
        self._fleet = fleet
        self._next = iter(costs)
        self._events: list[_Event] = []
        self._number = 0
        self._asked: deque[tuple[int, float]] = deque()  # which worker, since when
        self._idle = fleet.servers
        self._calls = [0] * fleet.workers  # still to be asked in the pair of a worker
        self._computes_s = [0.0] * fleet.workers  # before each of them, and after the last

    def run(self) -> None:
        """Play all pairs."""
        for worker in range(self._fleet.workers):
            self._begin(worker, self._fleet.start_s)
        while self._events:
            now, _, happens, workers = heapq.heappop(self._events)
            happens(now, workers)

    def _at(self, when: float, happens: _Happens, workers: tuple[int, ...]) -> None:
        self._number += 1  # what happens at the same time happens in the order in which that was known
        heapq.heappush(self._events, (when, self._number, happens, workers))

    def _begin(self, worker: int, now: float) -> None:
        """A worker begins the next pair, if there is one."""
        cost = next(self._next, None)
        if cost is not None:
            self.last_begin = now
            self._calls[worker] = round(cost.calls)
            self._computes_s[worker] = cost.worker_s / (self._calls[worker] + 1)
            self._compute(worker, now)

    def _compute(self, worker: int, now: float) -> None:
        self._at(now + self._computes_s[worker], self._ask if self._calls[worker] else self._end, (worker,))

    def _ask(self, now: float, workers: tuple[int, ...]) -> None:
        self._asked += [(worker, now) for worker in workers]
        self._serve(now)

    def _serve(self, now: float) -> None:
        """A server takes what waits, if one is free and something waits."""
        if not self._idle or not self._asked:
            return
        taken = [self._asked.popleft() for _ in range(min(len(self._asked), self._fleet.batch))]
        answer_s = self._fleet.answer_s(len(taken))
        self._idle -= 1
        self.batches += 1
        self.answered += len(taken)
        self.serving_s += answer_s
        self.waiting_s += sum(now + answer_s - since for _, since in taken)
        self._at(now + answer_s, self._answer, tuple(worker for worker, _ in taken))

    def _answer(self, now: float, workers: tuple[int, ...]) -> None:
        self._idle += 1
        for worker in workers:
            self._calls[worker] -= 1
            self._compute(worker, now)
        self._serve(now)

    def _end(self, now: float, workers: tuple[int, ...]) -> None:
        self.ends.append(now)
        for worker in workers:
            self._begin(worker, now)


_Happens = Callable[[float, tuple[int, ...]], None]
_Event = tuple[float, int, _Happens, tuple[int, ...]]
"""When, a number of its own, what happens, and to which workers."""
