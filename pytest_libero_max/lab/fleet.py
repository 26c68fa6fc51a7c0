"""Time that a fleet of workers and policy servers needs for pairs: the slowest of its three parts.

Workers take the next pair when they are free. With servers each query costs a worker the time of one answer,
as if no other worker asked; the servers answer batches without a pause; the process that owns the run
takes in one record after another. These are the asymptotic bounds of a closed queueing network (P. J. Denning
and J. P. Buzen (1978), Computing Surveys 10:225-261). A real fleet is slower where two parts are about as
busy: ``reports/cost.md`` says by how much.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.sampling import shard
from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.costs import Cost, CostModel, Kind
from pytest_libero_max.report.formats import counted
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.progress import duration
from pytest_libero_max.runs.store import StoredRun


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

    def answer_s(self, queries: float) -> float:
        """Seconds of an answer to this many queries at once."""
        alone = self.query_s or 0.0
        if self.batch_s is None or self.batch == 1:
            return alone
        return alone + (self.batch_s - alone) * (queries - 1) / (self.batch - 1)

    def policy_s(self, cost: Cost) -> float:
        """Seconds that a worker waits for the policy in a pair."""
        return cost.policy_s if self.query_s is None else cost.calls * self.query_s


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
    policy_s = [fleet.policy_s(cost) for cost in costs]
    pairs_s = [cost.worker_s + seconds for cost, seconds in zip(costs, policy_s, strict=True)]
    computing_s = sum(cost.worker_s for cost in costs) + (0.0 if fleet.servers else sum(policy_s))
    serving_s = 0.0
    if fleet.servers:
        batch = _batch(computing_s / max(calls, 1.0), fleet)
        serving_s = calls / batch * fleet.answer_s(batch) / fleet.servers
    free = [0.0] * fleet.workers
    for seconds in pairs_s:
        heapq.heapreplace(free, free[0] + seconds)
    needs = {
        "workers": max(free),
        "policy servers": serving_s,
        "controller": min(pairs_s) + len(costs) * fleet.record_s,
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


def workers_fed(costs: Sequence[Cost], fleet: Fleet) -> int | None:
    """Return the most workers whose records one controller takes in as they come; None for any number."""
    if not fleet.record_s:
        return None
    seconds = sum(cost.worker_s + fleet.policy_s(cost) for cost in costs)
    return max(int(seconds / (len(costs) * fleet.record_s)), 1)


def learn(stored: StoredRun) -> CostModel:
    """Return a cost model learnt from the measured pairs of a run."""
    if not stored.records:
        raise ReportError("The run has no measured pair. Play a few, for example --libero-max-limit=32.")
    model, planned = CostModel(), {pair.case_id: pair for pair in stored.run.planned}
    for record in stored.records:
        model.add(Kind.of(planned[record.case_id]), record)
    return model


def costs_of(pairs: Iterable[PlannedPair], stored: StoredRun, what: str) -> list[Cost]:
    """Return the expected costs of the pairs that the policy of a run plays, in the order in which it does.

    Raises:
        ReportError: The run has no measured pair, or its policy plays none of these.
    """
    model, pairs = learn(stored), sorted(pairs, key=lambda pair: pair.item_id)
    left_out = {pair.case_id for pair in unsupported_pairs(pairs, stored.records[0].policy)}
    costs = [model.drawn(Kind.of(pair), pair.case_id) for pair in pairs if pair.case_id not in left_out]
    if not costs:
        raise ReportError(f"The policy of the run supports no suite of {what}.")
    return costs


def plan_lines(stored: StoredRun, pairs: Iterable[PlannedPair], what: str, fleet: Fleet) -> list[str]:
    """Return the lines on a fleet that plays pairs of this name, from the timings of a run."""
    costs = costs_of(pairs, stored, what)
    if fleet.servers and fleet.query_s is None:
        calls = sum(cost.calls for cost in costs)
        fleet = replace(fleet, query_s=sum(cost.policy_s for cost in costs) / max(calls, 1.0))
    played = play(costs, fleet)
    mean = [sum(values) / len(costs) for values in zip(*costs, strict=True)]
    parts = {"workers": f"play {played.computing:.0%} of their time"}
    twice = {"workers": replace(fleet, workers=2 * fleet.workers)}
    if fleet.servers:
        parts["policy servers"] = f"answer {played.serving:.0%} of the time"
        twice["policy servers"] = replace(fleet, servers=2 * fleet.servers)
    parts["controller"] = f"takes in records {played.writing:.1%} of the time"
    larger = (f"twice the {name}: {duration(play(costs, other).seconds)}" for name, other in twice.items())
    return [
        f"Learnt from {counted(len(stored.records), 'measured pair')}. A pair is expected to take a worker "
        f"{mean[0]:.2f} s, and {mean[1]:.0f} calls of the policy, which took {mean[2]:.2f} s.",
        f"{what}, {counted(len(costs), 'pair')} with {_fleet_words(fleet)}:",
        f"  {duration(played.seconds)}, {60.0 * len(costs) / played.seconds:.4g} pairs/min",
        *(
            f"  {name:<15} {text}{'  <- the bottleneck' if name == played.bottleneck else ''}"
            for name, text in parts.items()
        ),
        *_too_many(costs, played, fleet),
        f"  with {', with '.join(larger)}",
    ]


def _fleet_words(fleet: Fleet) -> str:
    words = counted(fleet.workers, "worker")
    query = "" if fleet.query_s is None else f", {1e3 * fleet.query_s:.4g} ms a query"
    if not fleet.servers:
        return f"{words}, the policy in each of them{query}"
    words += f", {counted(fleet.servers, 'policy server')}{query}"
    if fleet.batch > 1:
        words += f", up to {fleet.batch} together in {1e3 * fleet.answer_s(fleet.batch):.4g} ms"
    return words


def _too_many(costs: Sequence[Cost], played: Played, fleet: Fleet) -> list[str]:
    most = workers_fed(costs, fleet)
    if played.bottleneck != "controller" or most is None or fleet.workers <= most:
        return []
    return [
        f"  one controller feeds {counted(most, 'worker')} with such pairs, and the others would wait: play "
        f"at least {-(-fleet.workers // most)} shards at once (--libero-max-shard), a controller each"
    ]


def shard_lines(stored: StoredRun, cases: Sequence[Case], count: int) -> list[str]:
    """Return the line on how evenly the parts of ``--libero-max-shard`` share the expected work."""
    parts = (map(PlannedPair.of, shard(cases, number, count)) for number in range(1, count + 1))
    seconds = [sum(cost.seconds for cost in costs_of(part, stored, "a shard")) for part in parts]
    mean, longest = sum(seconds) / count, max(seconds)
    return [
        f"{counted(count, 'shard')}: {duration(mean)} of one worker on average, at most {duration(longest)}, "
        f"{longest / mean:.2f} times that. More shards than are played at once share the work better."
    ]
