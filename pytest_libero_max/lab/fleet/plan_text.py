"""Text of ``libero-max plan time``: the time that pairs will take, from the timings of a measured run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.sampling import shard
from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.fleet.costs import Cost, CostModel, Kind
from pytest_libero_max.lab.fleet.fleet import Fleet, Played, play, workers_fed
from pytest_libero_max.report.formats import counted
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.progress import duration
from pytest_libero_max.runs.store import StoredRun


def learn(stored: StoredRun) -> CostModel:
    """Return a cost model learnt from the measured pairs of a run.

    Raises:
        ReportError: It has none.
    """
    if not stored.records:
        raise ReportError("The run has no measured pair. Play a few, for example --libero-max-limit=32.")
    model, planned = CostModel(), {pair.case_id: pair for pair in stored.run.planned}
    for record in stored.records:
        model.add(Kind.of(planned[record.case_id]), record)
    return model


def playable(pairs: Iterable[PlannedPair], stored: StoredRun) -> list[PlannedPair]:
    """Return the pairs that the policy of a run plays, in the order in which a run plays them."""
    pairs = sorted(pairs, key=lambda pair: pair.item_id)
    left_out = {pair.case_id for pair in unsupported_pairs(pairs, stored.records[0].policy)}
    return [pair for pair in pairs if pair.case_id not in left_out]


def plan_lines(stored: StoredRun, pairs: Iterable[PlannedPair], what: str, fleet: Fleet) -> list[str]:
    """Return the lines on a fleet that plays pairs.

    Args:
        stored: The run to learn from.
        pairs: The pairs to play.
        what: Their name.
        fleet: The fleet.

    Raises:
        ReportError: The run has no measured pair, or its policy plays none of these.
    """
    model, chosen = learn(stored), playable(pairs, stored)
    if not chosen:
        raise ReportError(f"The policy of the run supports no suite of {what}.")
    costs = [model.drawn(Kind.of(pair), pair.case_id) for pair in chosen]
    if fleet.servers and fleet.query_s is None:
        calls = sum(cost.calls for cost in costs)
        fleet = replace(fleet, query_s=sum(cost.policy_s for cost in costs) / max(calls, 1.0))
    played = play(costs, fleet)
    return [
        _learnt(stored, costs),
        f"{what}, {counted(len(chosen), 'pair')} with {_fleet_words(fleet)}:",
        f"  {duration(played.seconds)}, {60.0 * len(chosen) / played.seconds:.4g} pairs/min",
        *_shares(played, fleet),
        *_too_many(costs, played, fleet),
        _larger(costs, fleet),
    ]


def _learnt(stored: StoredRun, costs: Sequence[Cost]) -> str:
    mean = [sum(values) / len(costs) for values in zip(*costs, strict=True)]
    return (
        f"Learnt from {counted(len(stored.records), 'measured pair')}. A pair is expected to take a worker "
        f"{mean[0]:.2f} s, and {mean[1]:.0f} calls of the policy, which took {mean[2]:.2f} s."
    )


def _fleet_words(fleet: Fleet) -> str:
    words = counted(fleet.workers, "worker")
    if not fleet.servers:
        query = "" if fleet.query_s is None else f", {1e3 * fleet.query_s:.4g} ms a query"
        return f"{words}, the policy in each of them{query}"
    assert fleet.query_s is not None
    words += f", {counted(fleet.servers, 'policy server')}, {1e3 * fleet.query_s:.4g} ms a query"
    if fleet.batch > 1:
        full = fleet.answer_s(fleet.batch)
        words += f", up to {fleet.batch} together in {1e3 * full:.4g} ms"
    return words


def _shares(played: Played, fleet: Fleet) -> list[str]:
    """Lines on how busy each part of the fleet is, and which one is the bottleneck."""
    lines = [("workers", f"play {played.computing:.0%} of their time")]
    if fleet.servers:
        lines.append(("policy servers", f"answer {played.serving:.0%} of the time"))
    lines.append(("controller", f"takes in records {played.writing:.1%} of the time"))
    return [f"  {name:<15} {text}{_mark(name, played)}" for name, text in lines]


def _too_many(costs: Sequence[Cost], played: Played, fleet: Fleet) -> list[str]:
    """Return a line where there are more workers than one controller can feed."""
    most = workers_fed(costs, fleet)
    if played.bottleneck != "controller" or most is None or fleet.workers <= most:
        return []
    return [
        f"  one controller feeds {counted(most, 'worker')} with such pairs, and the others would wait: play "
        f"at least {-(-fleet.workers // most)} shards at once (--libero-max-shard), a controller each"
    ]


def _mark(name: str, played: Played) -> str:
    return "  <- the bottleneck" if name == played.bottleneck else ""


def _larger(costs: Sequence[Cost], fleet: Fleet) -> str:
    """Line on the time with twice the workers or servers."""
    twice = {"workers": replace(fleet, workers=2 * fleet.workers)}
    if fleet.servers:
        twice["policy servers"] = replace(fleet, servers=2 * fleet.servers)
    words = [f"twice the {name}: {duration(play(costs, larger).seconds)}" for name, larger in twice.items()]
    return f"  with {', with '.join(words)}"


def shard_lines(stored: StoredRun, cases: Sequence[Case], count: int) -> list[str]:
    """Return the line on how evenly the parts of ``--libero-max-shard`` share the expected work.

    Raises:
        ReportError: The run has no measured pair, or its policy plays none of the cases.
    """
    model = learn(stored)
    seconds = []
    for number in range(1, count + 1):
        pairs = playable(map(PlannedPair.of, shard(cases, number, count)), stored)
        seconds.append(sum(model.drawn(Kind.of(pair), pair.case_id).seconds for pair in pairs))
    mean, longest = sum(seconds) / count, max(seconds)
    if not mean:
        raise ReportError("The policy of the run supports no suite of these cases.")
    return [
        f"{counted(count, 'shard')}: {duration(mean)} of one worker on average, at most {duration(longest)}, "
        f"{longest / mean:.2f} times that. More shards than are played at once share the work better."
    ]
