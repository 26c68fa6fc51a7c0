"""From records to the report: one JSON document, the same bytes for the same pairs in any order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import msgspec
from msgspec import structs

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import EVENTS, families
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.broken import base_failures
from pytest_libero_max.report.caveats import caveats_of
from pytest_libero_max.report.diagnosis import CAUSES, changed_pairs, diagnose
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.inference import inference_of
from pytest_libero_max.report.probe_means import probe_means
from pytest_libero_max.report.report_document import (
    Cell,
    ClippedActions,
    Extremes,
    Headline,
    InvalidPair,
    Macros,
    MissingAsFailures,
    MissingPair,
    PairCounts,
    PlayedSelection,
    PresentShards,
    Report,
    Returned,
    Stop,
)
from pytest_libero_max.report.run_texts import alarm_texts
from pytest_libero_max.report.sections import PlayedPairs, measured_sections
from pytest_libero_max.report.statements import own_cases_text, statements_of
from pytest_libero_max.report.stopping_rule import bias_of, watched_by
from pytest_libero_max.report.studies.study_results import study_of
from pytest_libero_max.report.timing import success_curves
from pytest_libero_max.runs.agreement import policy_differences
from pytest_libero_max.runs.outcomes import Played, columns_of
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.stopped import Stopped, ended_by_rule
from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE, Outcomes, Result, Split, Substrate
from pytest_libero_max.stats.breakdown import breakdown, largest_split, macro_average
from pytest_libero_max.stats.intervals import CONFIDENCE
from pytest_libero_max.stats.measured import rate_of, ratio_of, tabulate, without_intervals
from pytest_libero_max.stats.paired import Pairs, measure
from pytest_libero_max.substrates.registry import scores_of

METHODS: Mapping[str, str | float] = {
    "confidence": CONFIDENCE,
    "rates": "exact interval (Clopper and Pearson); by_task: tasks resampled, for other tasks of the kind",
    "paired_change": "lower and upper: melded exact interval of independent pairs (Fay and Lumbard 2021), "
    "which agrees with the exact McNemar test and says how the pairs of these cases would come out again; "
    "by_task: tasks resampled, for other tasks of the same kind",
    "paired_change_bootstrap": "the paper's exact percentile bootstrap over pairs, for comparison with it; "
    "by_source keeps the pairs of each source; too narrow with few changed pairs",
    "mcnemar": "exact two-sided test of regressions against gains",
    "stale_actions": "over pairs with a query after the event; quantiles by inverse CDF",
    "time_to_success": "policy steps to success; an episode without success counts with its horizon; t "
    "interval over pairs, and tasks resampled for other tasks; success_curves are survival curves, one minus "
    "the empirical distribution: no pair is censored before its horizon",
    "after_the_event": "medians with intervals between order statistics, over the pairs that have the "
    "quantity; Base is measured from the step of Dynamic's event; stages are the first touch, grasp, lift, "
    "arrival above the destination and satisfaction of a fact of the goal, and success; one that was reached "
    "before the event does not count again",
    "macro": "unweighted mean over source categories; secondary to the rates over all pairs",
    "floor": f"true where Base success is below {FLOOR_BASE_RATE:g}; a small change is no robustness there",
    "breakdowns": "descriptive; groups hold different cases, so differences between them are no effects",
}


def build_report(
    records: Iterable[PairRecord],
    errors: Iterable[PairError],
    planned_cases: Iterable[Case | PlannedPair],
    provenance: Json,
    stopped: Stopped | None = None,
) -> Report:
    """Compute the report of a run.

    Rates over the planned pairs are in ``headline`` and are withheld (None, with the reason) while a pair
    is missing or invalid. Everything else is over the played pairs, and each block says how many were
    planned and played. Pairs of suites that the policy declares unsupported are not among the planned ones.
    ``policy`` is the spec the pairs were played with, None where no pair was.

    Args:
        records: Measured pairs in any order.
        errors: Pairs that could not be measured. One whose case has a record as well was repaired: it
            is named, and counts as played.
        planned_cases: Every assigned case; of a run that a rule stopped, in the order of play.
        provenance: See :func:`~pytest_libero_max.runs.provenance.collect`.
        stopped: Reason the run was stopped; None where it was not.

    Raises:
        ReportError: A pair occurs twice or was never planned, or the records are of several policies.
    """
    order = [PlannedPair.of(case) if isinstance(case, Case) else case for case in planned_cases]
    planned = sorted(order, key=lambda pair: pair.case_id)
    played = _by_case(records, {pair.case_id: pair for pair in planned})
    errors = tuple(errors)
    failed = {error.case_id: error for error in errors if error.case_id not in played}
    repaired = {error.item_id for error in errors if error.case_id in played}
    _require_planned(failed, {pair.case_id: pair for pair in planned})
    policy = next(iter(played.values())).policy if played else None
    with_intervals = not ended_by_rule(stopped, planned, policy, played.keys())
    if with_intervals and stopped is not None and stopped.rule is not None:
        stopped = None  # pairs in flight have completed the run
    unsupported = {
        pair.case_id: pair.suite
        for pair in unsupported_pairs(planned, policy)
        if pair.case_id not in played and pair.case_id not in failed
    }
    planned = [pair for pair in planned if pair.case_id not in unsupported]
    measured = [pair for pair in planned if pair.case_id in played]
    in_order = [played[pair.case_id] for pair in measured]
    tasks, protocol = [pair.task for pair in measured], provenance["protocol"]
    columns = columns_of(in_order, tasks)
    overall = structs.replace(measure(columns, len(planned)), probes=probe_means(in_order))
    selection = _selection(provenance)
    counts = counts_of(
        planned,
        played.keys(),
        failed,
        missing_shards=selection.missing_shards if selection else [],
        repaired=repaired,
        unsupported=unsupported,
        stopped=_stop(stopped, order, (*played.values(), *errors), provenance),
    )
    ends = {case_id: (it.base_success, it.dynamic_success) for case_id, it in played.items()}
    groups = outcome_groups(planned, measured, columns, ends)
    groups["by"] = {name: _with_probes(rows, measured, in_order, name) for name, rows in groups["by"].items()}
    report = Report(
        pairs=counts,
        selection=selection,
        headline=headline_of(counts, overall, stopped),
        missing_as_failures=missing_as_failures(counts, overall.outcomes),
        policy=policy,
        inference=inference_of(in_order, protocol),
        substrate=substrate_of(provenance, planned),
        caveats=caveats_of(map(Played.of, in_order)),
        overall=overall,
        returned=_returned(played.values()),
        clipped_actions=_clipped_actions(played.values()),
        changed_pairs=changed_pairs(played.values()),
        base_failures=base_failures([*played.values()]),
        causes={arm: _causes(played.values(), arm) for arm in (BASE, DYNAMIC)},
        **groups,
        success_curves=success_curves(in_order),
        study=study_of(in_order, tasks, protocol),
        sections=measured_sections(PlayedPairs(in_order, tasks, protocol, with_intervals)),
        statements=statements_of(
            provenance["case_set"]["name"], [pair.case_id for pair in planned], with_intervals=with_intervals
        ),
        methods=dict(METHODS),
        provenance=provenance,
    )
    if not with_intervals:
        # These are for a number of pairs that is fixed before. Those of the rule are in ``pairs``.
        report = structs.replace(without_intervals(report), pairs=counts)
    return structs.replace(report, warnings=alarm_texts(report))


def missing_as_failures(counts: PairCounts, outcomes: Outcomes) -> MissingAsFailures | None:
    """Return the rates over all planned pairs as the paper counts them; None where they say nothing.

    A run that stopped by a rule, or lacks a shard, never meant to play the others.
    """
    meant = counts.stopped is None or counts.stopped.rule is None
    if counts.complete or not counts.played or counts.missing_shards or not meant:
        return None
    failed = structs.replace(
        outcomes, persistent_failure=outcomes.persistent_failure + counts.planned - counts.played
    )
    return MissingAsFailures(
        without_result=counts.planned - counts.played,
        base_success=rate_of(failed.base),
        dynamic_success=rate_of(failed.dynamic),
        paired_change=ratio_of(failed.change),
    )


def _causes(records: Iterable[PairRecord], arm: str) -> dict[str, int]:
    found = Counter(why.cause for record in records if (why := diagnose(record, arm)) is not None)
    return {cause: found[cause] for cause in CAUSES if found[cause]}


def _returned(records: Iterable[PairRecord]) -> Returned | None:
    """Return the numbers of actions that servers returned; None where no record says."""
    found = [arm.returned for record in records for arm in record.arms.values() if arm.returned is not None]
    return (
        Returned(least=min(low for low, _ in found), most=max(high for _, high in found)) if found else None
    )


def _clipped_actions(records: Iterable[PairRecord]) -> ClippedActions | None:
    shares = [max(arm.clipped_share for arm in record.arms.values()) for record in records]
    if not shares:
        return None
    return ClippedActions(pairs=sum(share > 0 for share in shares), largest_share=max(shares))


def _by_case(records: Iterable[PairRecord], planned: Mapping[str, PlannedPair]) -> dict[str, PairRecord]:
    played: dict[str, PairRecord] = {}
    for record in records:
        if record.case_id in played:
            raise ReportError(
                f"case_id={record.case_id!r} was measured twice; a case counts once. Keep one of the records."
            )
        played[record.case_id] = record
    _require_planned(played, planned)
    for case_id, record in played.items():
        if record.case_digest != planned[case_id].case_digest:
            raise ReportError(
                f"The record of case_id={case_id!r} has case_digest={record.case_digest!r}, but the planned "
                f"case has {planned[case_id].case_digest!r}: another case was played. Play it again."
            )
    specs = [record.policy for record in played.values()]
    for spec in specs:
        different = policy_differences(specs[0], spec)
        if different:
            raise ReportError(
                f"The records are of several policies ({'; '.join(different)}), but a report is of one. "
                "Compare runs instead of mixing them."
            )
    return played


def _require_planned(pairs: Mapping[str, object], planned: Mapping[str, PlannedPair]) -> None:
    strays = sorted(pairs.keys() - planned.keys())
    if strays:
        raise ReportError(
            f"case_id={strays[0]!r} ({len(strays)} in all) was played but not planned; a report keeps the "
            "planned denominator. Use the manifest of the run."
        )


def outcome_groups(
    planned: Sequence[PlannedPair],
    measured: Sequence[PlannedPair],
    columns: Pairs,
    ends: Mapping[str, tuple[bool, bool]],
) -> dict[str, Any]:
    """Return the fields of a report that group pairs, as far as they follow from outcomes."""
    by = {name: _group(planned, measured, columns, name) for name in DIMENSIONS}
    return {
        "by": by,
        "category_by_event": _cells(planned, ends),
        "macro": Macros(category=macro_average([row.outcomes for row in by["category"].values()])),
        "largest_split": split_of(_outcomes(by["variant"])),
        "extremes": extremes_of(_outcomes(by["category"])),
    }


def _group(
    planned: Sequence[PlannedPair], measured: Sequence[PlannedPair], columns: Pairs, dimension: str
) -> dict[str, Result]:
    label = DIMENSIONS[dimension].label
    totals = Counter(label(pair) for pair in planned)
    labels = [label(pair) for pair in measured]
    names = sorted(totals, key=lambda name: group_order(dimension, name))
    return {name: row for name, row in breakdown(columns, labels, names, totals).items() if name}


def _with_probes(
    rows: Mapping[str, Result], measured: Sequence[PlannedPair], records: Sequence[PairRecord], dimension: str
) -> dict[str, Result]:
    """Return the results of groups with the means of probes over their pairs."""
    members: dict[str, list[PairRecord]] = {}
    for pair, record in zip(measured, records, strict=True):
        members.setdefault(DIMENSIONS[dimension].label(pair), []).append(record)
    return {
        name: structs.replace(row, probes=probe_means(members.get(name, ()))) for name, row in rows.items()
    }


def _cells(
    planned: Sequence[PlannedPair], ends: Mapping[str, tuple[bool, bool]]
) -> dict[str, dict[str, Cell]]:
    """Planned pairs, outcomes and paired change of each source category under each event."""
    cells: dict[tuple[str, str], list[PlannedPair]] = {}
    for pair in planned:
        cells.setdefault((pair.category, pair.event), []).append(pair)
    table: dict[str, dict[str, Cell]] = {category: {} for category, _ in sorted(cells)}
    for category, event in sorted(cells, key=lambda cell: (cell[0], group_order("event", cell[1]))):
        pairs = cells[category, event]
        rows = [ends[pair.case_id] for pair in pairs if pair.case_id in ends]
        outcomes = tabulate([base for base, _ in rows], [dynamic for _, dynamic in rows])
        table[category][event] = Cell(
            planned=len(pairs), outcomes=outcomes, paired_change=ratio_of(outcomes.change)
        )
    return table


def group_order(dimension: str, name: str) -> tuple[int, str]:
    """Return the sort key of a group: events and families in the benchmark's order, all else by name."""
    ranked = {"event": [*EVENTS], "variant": [*EVENTS], "family": [*families()]}.get(dimension, [])
    key = name.partition("-")[0]
    return (ranked.index(key) if key in ranked else len(ranked)), name


def _outcomes(groups: Mapping[str, Result]) -> dict[str, Outcomes]:
    return {name: result.outcomes for name, result in groups.items()}


def extremes_of(categories: Mapping[str, Outcomes]) -> dict[str, Extremes]:
    """Return by source the categories of lowest Base success and of largest loss, the first among equals."""
    sources: dict[str, dict[str, Outcomes]] = {}
    for name, outcomes in categories.items():
        if outcomes.total:
            sources.setdefault(name.partition("-")[0], {})[name] = outcomes
    return {
        source: Extremes(
            lowest_base_success=min(cells, key=lambda name: cells[name].base.value or 0.0),
            largest_loss=min(cells, key=lambda name: cells[name].change.value or 0.0),
        )
        for source, cells in sources.items()
    }


def split_of(variants: Mapping[str, Outcomes]) -> Split | None:
    """Return the event whose parameter variants differ most in Dynamic success; None where none has two."""
    events: dict[str, dict[str, Outcomes]] = {}
    for name, outcomes in variants.items():
        event, _, variant = name.rpartition("-")
        events.setdefault(event, {})[variant] = outcomes
    return largest_split(events)


def _selection(provenance: Json) -> PlayedSelection | None:
    """Part of the case set that was played; None for a run of a version that did not record it."""
    if "selection" not in provenance:
        return None
    selection = Selection.from_dict(provenance["selection"])
    shards = selection.shards
    return PlayedSelection(
        asked=list(selection.asked),
        chosen=selection.chosen,
        of=selection.of,
        digest=selection.digest,
        shards=None if shards is None else PresentShards(of=shards.of, present=list(shards.present)),
        merged=selection.merged,
        whole=selection.whole,
        missing_shards=[f"{number}/{shards.of}" for number in selection.missing_shards] if shards else [],
        text=selection.text(provenance["case_set"]["name"]),
    )


def counts_of(
    planned: Sequence[PlannedPair],
    played: Collection[str],
    failed: Mapping[str, PairError],
    *,
    missing_shards: Sequence[str] = (),
    repaired: Iterable[str] = (),
    unsupported: Mapping[str, str] | None = None,
    stopped: Stop | None = None,
) -> PairCounts:
    """Return the numbers of planned, played and lost pairs, and which were lost."""
    unsupported = unsupported or {}
    missing = [pair for pair in planned if pair.case_id not in played and pair.case_id not in failed]
    complete = bool(planned) and len(played) == len(planned) and not missing_shards
    return PairCounts(
        planned=len(planned),
        played=len(played),
        invalid=len(failed),
        missing=len(missing),
        complete=complete,
        missing_shards=[*missing_shards],
        invalid_pairs=[
            msgspec.convert(error, InvalidPair, from_attributes=True) for _, error in sorted(failed.items())
        ],
        missing_pairs=[MissingPair(case_id=pair.case_id, item_id=pair.item_id) for pair in missing],
        repaired_pairs=sorted(repaired),
        unsupported=len(unsupported),
        unsupported_suites=sorted({*unsupported.values()}),
        stopped=None if complete else stopped,
    )


def _stop(
    stopped: Stopped | None,
    planned: Iterable[PlannedPair],
    pairs: Iterable[PairRecord | PairError],
    provenance: Json,
) -> Stop | None:
    if stopped is None:
        return None
    watched = watched_by(stopped, planned, pairs, provenance.get("gates") or ())
    bias = bias_of(stopped)
    return Stop(
        reason=stopped.reason, of=stopped.of, rule=stopped.rule, at=stopped.at, bias=bias, watched=watched
    )


def substrate_of(provenance: Json, planned: Iterable[PlannedPair]) -> Substrate:
    """Return the substrate of a run, and the standing of its scores.

    Args:
        provenance: As the run recorded it. Older runs recorded the name alone.
    """
    name = provenance["substrate"]["name"]
    own = own_cases_text(provenance["case_set"]["name"], [pair.suite for pair in planned])
    scores = provenance["scores"] if "scores" in provenance else scores_of(name)
    return Substrate(
        name=name,
        scores_comparable_with_published=scores["comparable_with_published"],
        note=" ".join(text for text in (scores["note"], own) if text) or None,
    )


def headline_of(counts: PairCounts, overall: Result, stopped: Stopped | None = None) -> Headline:
    """Return the rates over all planned pairs; withheld while one is missing or invalid."""
    if counts.complete:
        return Headline(
            status="complete",
            reason=None,
            base_success=overall.base_success,
            dynamic_success=overall.dynamic_success,
            paired_change=overall.paired_change,
        )
    lost = [
        f"{count} {name}"
        for count, name in ((counts.invalid, "invalid"), (counts.missing, "missing"))
        if count
    ]
    lost += [f"shard {shard} not among the merged runs" for shard in counts.missing_shards]
    if stopped is not None:
        lost.append(stopped.text)
    reason = (
        f"{counts.played} of {counts.planned} planned pairs were played ({', '.join(lost)}); "
        "rates over all planned pairs are withheld until the rest is repaired and played"
        if counts.planned
        else "no pair was planned"
    )
    return Headline(status="withheld", reason=reason)
