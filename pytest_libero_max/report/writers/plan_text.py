"""How long pairs will take, from the timings of a run that is measured, in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.sharding import shard
from pytest_libero_max.costs.fleet import Fleet, Played, play
from pytest_libero_max.costs.model import Cost, CostModel
from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.progress import duration
from pytest_libero_max.runs.store import StoredRun


def learn(stored: StoredRun) -> CostModel:
    """What the measured pairs of a run say of costs.

    Raises:
        ReportError: It has none.
    """
    if not stored.records:
        raise ReportError("The run has no measured pair. Play a few, for example --libero-max-limit=32.")
    model, planned = CostModel(), {pair.case_id: pair for pair in stored.run.planned}
    for record in stored.records:
        model.add(planned[record.case_id].kind, record)
    return model


def playable(pairs: Iterable[PlannedPair], stored: StoredRun) -> list[PlannedPair]:
    """The pairs that the policy of a run plays, in the order in which a run plays them."""
    pairs = sorted(pairs, key=lambda pair: pair.item_id)
    left_out = {pair.case_id for pair in unsupported_pairs(pairs, stored.records[0].policy)}
    return [pair for pair in pairs if pair.case_id not in left_out]


def plan_lines(stored: StoredRun, pairs: Iterable[PlannedPair], what: str, fleet: Fleet) -> list[str]:
    """What there is to say of a fleet that plays pairs.

    Args:
        stored: The run that is learnt from.
        pairs: What the fleet plays.
        what: Their name.
        fleet: Who plays.

    Raises:
        ReportError: The run has no measured pair, or its policy plays none of these.
    """
    model, chosen = learn(stored), playable(pairs, stored)
    if not chosen:
        raise ReportError(f"The policy of the run supports no suite of {what}.")
    costs = [model.drawn(pair.kind, pair.case_id) for pair in chosen]
    if fleet.servers and fleet.query_s is None:
        calls = sum(cost.calls for cost in costs)
        fleet = replace(fleet, query_s=sum(cost.policy_s for cost in costs) / max(calls, 1.0))
    played = play(costs, fleet)
    return [
        _learnt(stored, costs),
        f"{what}, {len(chosen)} pairs with {_fleet_words(fleet)}:",
        f"  {duration(played.seconds)}, {60.0 * len(chosen) / played.seconds:.4g} pairs/min",
        *_shares(played, fleet),
        *_larger(costs, fleet, played),
    ]


def _learnt(stored: StoredRun, costs: Sequence[Cost]) -> str:
    mean = [sum(values) / len(costs) for values in zip(*costs, strict=True)]
    return (
        f"Learnt from {len(stored.records)} measured pairs. A pair here is expected to take a worker "
        f"{mean[0]:.2f} s, and {mean[1]:.0f} calls of the policy, which took {mean[2]:.2f} s."
    )


def _fleet_words(fleet: Fleet) -> str:
    words = _count(fleet.workers, "worker")
    if not fleet.servers:
        query = "" if fleet.query_s is None else f", {1e3 * fleet.query_s:.4g} ms a query"
        return f"{words}, the policy in each of them{query}"
    assert fleet.query_s is not None
    words += f", {_count(fleet.servers, 'policy server')}, {1e3 * fleet.query_s:.4g} ms a query"
    if fleet.batch > 1:
        full = fleet.answer_s(fleet.batch)
        words += f", up to {fleet.batch} together in {1e3 * full:.4g} ms"
    return words


def _shares(played: Played, fleet: Fleet) -> list[str]:
    """What everybody does with the time, and who has too much to do."""
    idle = max(1.0 - played.computing - played.waiting, 0.0)
    words = [f"play {played.computing:.0%} of their time"]
    words += [f"wait for answers {played.waiting:.0%}"] if fleet.servers else []
    words += [f"have nothing to do {idle:.0%}"]
    lines = [("workers", ", ".join(words))]
    if fleet.servers:
        batch = f", {played.batch:.1f} queries together" if fleet.batch > 1 else ""
        lines.append(("policy servers", f"answer {played.serving:.0%} of the time{batch}"))
    lines.append(("controller", f"takes in records {played.writing:.1%} of the time"))
    return [f"  {name:<15} {text}{_mark(name, played)}" for name, text in lines]


def _mark(name: str, played: Played) -> str:
    return "  <- the bottleneck" if name == played.bottleneck else ""


def _larger(costs: Sequence[Cost], fleet: Fleet, played: Played) -> list[str]:
    """What more of something would bring."""
    twice = {"workers": replace(fleet, workers=2 * fleet.workers)}
    if fleet.servers:
        twice["policy servers"] = replace(fleet, servers=2 * fleet.servers)
    words = [f"twice the {name}: {duration(play(costs, larger).seconds)}" for name, larger in twice.items()]
    lines = [f"  with {', with '.join(words)}"]
    if played.simulated < len(costs):
        lines.append(
            f"  {played.simulated} of these pairs were played event by event; the others keep their pace"
        )
    return lines


def shard_lines(stored: StoredRun, cases: Sequence[Case], count: int) -> list[str]:
    """How well the parts of ``--libero-max-shard`` share the work, as it is expected.

    Raises:
        ReportError: The run has no measured pair, or its policy plays none of the cases.
    """
    model = learn(stored)
    seconds = []
    for number in range(1, count + 1):
        pairs = playable(map(PlannedPair.of, shard(cases, number, count)), stored)
        seconds.append(sum(model.drawn(pair.kind, pair.case_id).seconds for pair in pairs))
    mean, longest = sum(seconds) / count, max(seconds)
    if not mean:
        raise ReportError("The policy of the run supports no suite of these cases.")
    return [
        f"{count} shards: {duration(mean)} of one worker on average, the longest {duration(longest)}, "
        f"{longest / mean:.2f} times that. More shards than are played at once share the work better."
    ]


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'' if number == 1 else 's'}"
