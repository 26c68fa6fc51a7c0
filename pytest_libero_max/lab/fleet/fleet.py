"""Time that a fleet of workers and policy servers needs for pairs: the slowest of its three parts.

Workers take the next pair when they are free. With servers each query costs a worker the time of one answer,
as if no other worker asked; the servers answer batches without a pause; the process that owns the run
takes in one record after another. These are the asymptotic bounds of a closed queueing network (P. J. Denning
and J. P. Buzen (1978), Computing Surveys 10:225-261). A real fleet is slower where two parts are about as
busy: ``reports/cost.md`` says by how much.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

from pytest_libero_max.lab.fleet.costs import Cost


@dataclass(frozen=True)
class Fleet:
    """Workers, policy servers and the times they need."""

    workers: int
    """Processes that play pairs, each on a processor core of its own."""
    servers: int = 0
    """Policy servers, which answer one batch at a time; 0: each worker has the policy in it."""
    query_s: float | None = None
    """Seconds of a query that is answered alone; None: as in the run that was measured."""
    batch: int = 1
    batch_s: float | None = None
    """Seconds of a full batch; None: those of one query. In between they are interpolated."""
    record_s: float = 0.0
    """Seconds that the process that owns the run needs to receive, check and write a pair."""
    start_s: float = 0.0
    """Seconds before a worker begins its first pair."""

    def answer_s(self, queries: float) -> float:
        """Seconds of an answer to this many queries at once."""
        alone = self.query_s or 0.0
        if self.batch_s is None or self.batch == 1:
            return alone
        return alone + (self.batch_s - alone) * (queries - 1) / (self.batch - 1)


@dataclass(frozen=True)
class Played:
    """Time that a fleet needs, and the use of its parts."""

    seconds: float
    """From the start of the workers until the last record is written."""
    bottleneck: str
    """``workers``, ``policy servers`` or ``controller``: the part that needs longest."""
    computing: float
    """Share of the workers' time in which they play, the policy in them included."""
    serving: float
    """Share of the servers' time in which they answer."""
    writing: float
    """Share of the time in which the process that owns the run takes in records."""


def play(costs: Sequence[Cost], fleet: Fleet) -> Played:
    """Return the time that a fleet needs for pairs that it plays in their order."""
    calls = sum(cost.calls for cost in costs)
    policy_s = [_policy_s(cost, fleet) for cost in costs]
    pairs_s = [cost.worker_s + seconds for cost, seconds in zip(costs, policy_s, strict=True)]
    computing_s = sum(cost.worker_s for cost in costs) + (0.0 if fleet.servers else sum(policy_s))
    serving_s = 0.0
    if fleet.servers:
        think_s = computing_s / max(calls, 1.0)
        batch = _batch(think_s, fleet)
        serving_s = calls / batch * fleet.answer_s(batch) / fleet.servers
    needs = {
        "workers": _in_turn(pairs_s, fleet),
        "policy servers": fleet.start_s + serving_s,
        "controller": fleet.start_s + min(pairs_s) + len(costs) * fleet.record_s,
    }
    bottleneck = max(needs, key=lambda name: needs[name])
    seconds = max(needs[bottleneck], needs["workers"] + fleet.record_s)
    return Played(
        seconds=seconds,
        bottleneck=bottleneck,
        computing=computing_s / (seconds * fleet.workers),
        serving=serving_s / seconds,
        writing=len(costs) * fleet.record_s / seconds,
    )


def workers_fed(costs: Sequence[Cost], fleet: Fleet) -> int | None:
    """Return the largest number of workers whose records one controller takes in as they come.

    Returns:
        At least 1; None where a record takes no time.
    """
    if not fleet.record_s:
        return None
    seconds = sum(cost.worker_s + _policy_s(cost, fleet) for cost in costs)
    return max(int(seconds / (len(costs) * fleet.record_s)), 1)


def _policy_s(cost: Cost, fleet: Fleet) -> float:
    """Seconds that a worker waits for the policy in a pair."""
    return cost.policy_s if fleet.query_s is None else cost.calls * fleet.query_s


def _batch(think_s: float, fleet: Fleet) -> float:
    """Mean number of queries that a busy server answers together.

    While a batch is answered, the next one gathers: a worker is in the one, on average for half of the time
    in the other, or computes for ``think_s`` before it asks again.
    """
    batch, workers = 1.0, fleet.workers / fleet.servers
    for _ in range(50):  # of a fixed-point iteration that converges in fewer
        answer_s = fleet.answer_s(batch)
        together = workers * answer_s / (1.5 * answer_s + think_s) if answer_s else 1.0
        batch = min(float(fleet.batch), max(together, 1.0))
    return batch


def _in_turn(pairs_s: Sequence[float], fleet: Fleet) -> float:
    """Seconds until workers that each take the next pair have played all."""
    free = [fleet.start_s] * fleet.workers
    for seconds in pairs_s:
        heapq.heapreplace(free, free[0] + seconds)
    return max(free)
