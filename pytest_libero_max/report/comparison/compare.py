"""Comparison of several runs on the same cases: success of each, and the cases that changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.build import group_order, substrate_of
from pytest_libero_max.report.caveats import caveat_text, caveats_of
from pytest_libero_max.report.comparison.comparison_document import (
    ApartRun,
    CommonPairs,
    ComparedRun,
    Comparison,
    EventContrasts,
    EventProfiles,
    Flip,
    LowestEvent,
    Outcome,
    OverRuns,
    RunDifference,
)
from pytest_libero_max.report.measurable import warning_of
from pytest_libero_max.report.report_document import Caveat
from pytest_libero_max.report.statements import statements_of
from pytest_libero_max.report.stopping_rule import bias_of
from pytest_libero_max.runs.comparability import (
    COMPARISON,
    Difference,
    differences_between,
    policy_differences,
)
from pytest_libero_max.runs.outcomes import RunOutcomes, read_outcomes
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats.blocks import ChangeContrast, GroupContrast, Result, SuccessContrast
from pytest_libero_max.stats.breakdown import breakdown, lowest_by_chance
from pytest_libero_max.stats.comparison import (
    change_contrasts,
    contrasts,
    group_change_contrasts,
    group_contrasts,
    profile_agreement,
    rank_sets,
    ranks,
)
from pytest_libero_max.stats.measured import number, without_intervals
from pytest_libero_max.stats.paired import Pairs, measure, measure_groups

Runs = dict[str, RunOutcomes]


def set_apart(runs: Mapping[str, RunOutcomes]) -> tuple[Runs, Runs]:
    """Return the runs to compare, and those to list apart.

    A run is listed apart if its policy declares that it does not support a suite whose cases the policy of
    another run supports: its own cases would then cut those of all others. Where fewer than two runs would
    be left, none is listed apart.
    """
    left_out = {
        name: {pair.case_id for pair in unsupported_pairs(run.run.planned, run.policy)}
        for name, run in runs.items()
    }
    supported = set().union(
        *({pair.case_id for pair in run.run.planned} - left_out[name] for name, run in runs.items())
    )
    whole = {name: run for name, run in runs.items() if left_out[name].isdisjoint(supported)}
    if len(whole) < 2:
        return dict(runs), {}
    return whole, {name: run for name, run in runs.items() if name not in whole}


def apart_run(name: str, run: RunOutcomes) -> ApartRun:
    """Return the results of a run over the cases that its policy supports, in all and by suite."""
    unsupported = unsupported_pairs(run.run.planned, run.policy)
    lacking = {pair.case_id for pair in unsupported}
    planned = {pair.case_id: pair for pair in run.run.planned if pair.case_id not in lacking}
    places = [index for index, case_id in enumerate(run.case_ids) if case_id in planned]
    pairs = run.pairs.at(places).numbered()
    suites = [pair.suite for pair in planned.values()]
    played = [planned[run.case_ids[index]].suite for index in places]
    counts = {suite: suites.count(suite) for suite in sorted({*suites})}
    result = measure(pairs, len(planned))
    by_suite = breakdown(pairs, played, [*counts], counts)
    if run.stopped_by_rule:
        result = without_intervals(result)
        by_suite = {suite: without_intervals(row) for suite, row in by_suite.items()}
    return ApartRun(
        name=name,
        policy=run.policy,
        unsupported=len(unsupported),
        unsupported_suites=sorted({pair.suite for pair in unsupported}),
        result=result,
        by_suite=by_suite,
        warnings=run_warnings(run, result),
        caveats=run_caveats(run, planned),
    )


def run_warnings(run: RunOutcomes, result: Result) -> list[str]:
    """Return what keeps the numbers of a run from saying what they seem to: a floor, or its stopping rule."""
    warnings = [warning_of(result)]
    if run.stopped is not None and run.stopped_by_rule:
        warnings.append(
            f"{run.stopped.text}. It has no 95% intervals and no p-values here: these need a number of pairs "
            "that is fixed before the run."
        )
        warnings.append(bias_of(run.stopped))
    return [text for text in warnings if text]


def run_caveats(run: RunOutcomes, cases: Collection[str]) -> list[Caveat]:
    """Return the caveats on the pairs of some cases of a run."""
    return caveats_of(
        played for case_id, played in zip(run.case_ids, run.played, strict=True) if case_id in cases
    )


def notes_of(name: str, run: RunOutcomes, result: Result, cases: Collection[str]) -> list[str]:
    """Return the warnings and the caveats of one run over some cases, each with its name."""
    return [
        *(f"{name}: {text}" for text in run_warnings(run, result)),
        *(f"{name}: {caveat_text(caveat)}" for caveat in run_caveats(run, cases)),
    ]


AnyContrast = TypeVar("AnyContrast", SuccessContrast, ChangeContrast, GroupContrast)


@dataclass(frozen=True)
class CommonCases:
    """The cases several runs share, in one order."""

    planned: tuple[PlannedPair, ...]
    pairs: Mapping[str, Pairs]
    """Outcomes of each run in that order."""
    left_out: Mapping[str, tuple[str, ...]]
    """Planned cases of each run that are not compared."""
    unsupported: Mapping[str, int]
    """Number of planned cases of each run that its policy does not support."""

    @property
    def partial(self) -> bool:
        """True if some policy does not support all cases."""
        return any(self.unsupported.values())


def common_cases(runs: Mapping[str, StoredRun | RunOutcomes], restrict: bool = False) -> CommonCases:
    """Line up the cases that every run has measured.

    Cases that a policy declares unsupported are left out of all runs.

    Raises:
        ReportError: Fewer than two runs, runs of different substrates or different cases of one name, no
            common case, or runs that differ in their cases without ``restrict``.
    """
    if len(runs) < 2:
        raise ReportError(f"{len(runs)} run given, but a comparison is of two or more.")
    return lined_up({name: _outcomes(run) for name, run in runs.items()}, restrict)


def lined_up(outcomes: Mapping[str, RunOutcomes], restrict: bool = False) -> CommonCases:
    """Line up the cases of any number of runs; see :func:`common_cases`."""
    planned = _all_planned(outcomes)
    places = {
        name: {case_id: index for index, case_id in enumerate(run.case_ids)} for name, run in outcomes.items()
    }
    common = sorted(set.intersection(*(set(measured) for measured in places.values())) & planned.keys())
    compared = set(common)
    left_out = {
        name: tuple(sorted({pair.case_id for pair in run.run.planned} - compared))
        for name, run in outcomes.items()
    }
    unsupported = {
        name: {pair.case_id for pair in unsupported_pairs(run.run.planned, run.policy)}
        for name, run in outcomes.items()
    }
    by_some = set().union(*unsupported.values())
    if not common:
        raise ReportError("The runs have no measured case in common; there is nothing to compare.")
    if not restrict and any(set(cases) - by_some for cases in left_out.values()):
        counts = ", ".join(f"{len(cases)} of {name!r}" for name, cases in left_out.items())
        raise ReportError(
            f"The runs do not share all cases: left out would be {counts}. Play the missing pairs, or "
            f"compare the common cases alone ({len(common)} of them): libero-max compare --restrict."
        )
    return CommonCases(
        planned=tuple(planned[case_id] for case_id in common),
        pairs={
            name: run.pairs.at([places[name][case_id] for case_id in common])
            for name, run in outcomes.items()
        },
        left_out=left_out,
        unsupported={name: len(cases) for name, cases in unsupported.items()},
    )


def _all_planned(outcomes: Mapping[str, RunOutcomes]) -> dict[str, PlannedPair]:
    """Return the planned cases of all runs by their ids."""
    substrates = sorted({run.run.provenance["substrate"]["name"] for run in outcomes.values()})
    if len(substrates) > 1:
        raise ReportError(
            f"The runs are of the substrates {' and '.join(substrates)}, whose scores are not comparable. "
            "Compare runs of one substrate."
        )
    planned: dict[str, PlannedPair] = {}
    for name, run in outcomes.items():
        for pair in run.run.planned:
            known = planned.setdefault(pair.case_id, pair)
            if known is not pair and known.case_digest != pair.case_digest:
                raise ReportError(
                    f"case_id={pair.case_id!r} of run {name!r} is another case than in the other runs: the "
                    "manifests differ. Play both with the same manifest."
                )
    return planned


def compared_and_apart(
    runs: Mapping[str, StoredRun | RunOutcomes], restrict: bool = False
) -> tuple[dict[str, RunOutcomes], dict[str, RunOutcomes]]:
    """Return the runs that :func:`compare_runs` compares, and those that it lists apart."""
    outcomes = {name: _outcomes(run) for name, run in runs.items()}
    _all_planned(outcomes)
    return (outcomes, {}) if restrict else set_apart(outcomes)


def _outcomes(run: StoredRun | RunOutcomes) -> RunOutcomes:
    return run if isinstance(run, RunOutcomes) else RunOutcomes.of(run)


def compare_runs(runs: Mapping[str, StoredRun | RunOutcomes], restrict: bool = False) -> Comparison:
    """Compare runs on their common cases.

    Runs of policies that support a part of the suites are listed apart, unless ``restrict`` asks for the
    cases that all share (see :func:`~pytest_libero_max.report.comparison.compare.set_apart`).

    Every family of contrasts holds all pairs of runs (and all events, for those by event). Holm's correction
    and the simultaneous intervals are over the family. Flips are the cases whose pair of outcomes differs
    between runs.
    """
    outcomes, apart = compared_and_apart(runs, restrict)
    common = common_cases(outcomes, restrict)
    sides = {name: run.side for name, run in outcomes.items()}
    pairs = {name: columns.numbered() for name, columns in common.pairs.items()}
    labels = np.asarray([pair.event for pair in common.planned])
    events = sorted(set(labels.tolist()), key=lambda event: group_order("event", event))
    masks = {event: labels == event for event in events}
    results = dict(zip(pairs, measure_groups(list(pairs.values())), strict=True))
    by_event = {name: breakdown(columns, labels, events) for name, columns in pairs.items()}
    changes = {
        name: [group.outcomes.change.count / group.outcomes.total for group in groups.values()]
        for name, groups in by_event.items()
    }
    agreement = profile_agreement(changes)
    ranked = ranks(
        {
            name: None if common.unsupported[name] else result.outcomes.dynamic.value
            for name, result in results.items()
        }
    )
    base = {name: columns.base for name, columns in pairs.items()}
    dynamic = {name: columns.dynamic for name, columns in pairs.items()}
    labelled = next(iter(pairs.values()))
    tasks, sources = labelled.task, labelled.source
    by_run = contrasts(dynamic, sources, tasks=tasks)
    stopped = {name for name, run in outcomes.items() if run.stopped_by_rule}
    open_ranks = {}
    if not stopped:
        open_ranks = rank_sets([name for name, rank in ranked.items() if rank is not None], by_run)
    by_group = group_contrasts(dynamic, masks)
    changes_by_group = group_change_contrasts(base, dynamic, masks)
    case_ids = {pair.case_id for pair in common.planned}
    rows = []
    for name, result in results.items():
        highest, lowest = open_ranks.get(name, (None, None))
        compared = ComparedRun(
            name=name,
            rank=ranked[name],
            highest_rank=highest,
            lowest_rank=lowest,
            policy=outcomes[name].policy,
            replay=list(replay_command(outcomes[name])),
            base_success=result.base_success,
            dynamic_success=result.dynamic_success,
            paired_change=result.paired_change,
            outcomes=result.outcomes,
            conditional_regression=result.conditional_regression,
            trigger_coverage=result.trigger_coverage,
            response_coverage=result.response_coverage,
            by_event={event: group.paired_change for event, group in by_event[name].items()},
            lowest_event=_lowest_event(by_event[name]),
            warnings=run_warnings(outcomes[name], result),
            caveats=run_caveats(outcomes[name], case_ids),
        )
        rows.append(without_intervals(compared) if name in stopped else compared)
    return Comparison(
        pairs=CommonPairs(
            common=len(common.planned),
            restricted=any(common.left_out.values()),
            left_out={name: list(cases) for name, cases in common.left_out.items()},
            unsupported=dict(common.unsupported),
        ),
        substrate=substrate_of(next(iter(outcomes.values())).run.provenance, common.planned),
        differences=list(map(_difference, differences_between(sides, COMPARISON))),
        policies=list(map(_difference, policy_differences(sides))),
        runs=rows,
        apart=[apart_run(name, run) for name, run in apart.items()],
        contrasts=_of_fixed_runs(by_run, stopped),
        base_contrasts=_of_fixed_runs(contrasts(base, sources, tasks=tasks), stopped),
        change_contrasts=_of_fixed_runs(change_contrasts(base, dynamic, tasks), stopped),
        by_event={
            event: EventContrasts(
                dynamic_success=_of_fixed_runs(by_group[event], stopped),
                paired_change=_of_fixed_runs(changes_by_group[event], stopped),
            )
            for event in events
        },
        events={
            event: _over_runs([changes[name][index] for name in pairs]) for index, event in enumerate(events)
        },
        event_profiles=EventProfiles(
            mean_spearman=number(agreement.mean),
            lowest=number(agreement.lowest),
            highest=number(agreement.highest),
        ),
        flips=_flips(common),
        statements=statements_of(
            next(iter(outcomes.values())).run.provenance["case_set"]["name"],
            [pair.case_id for pair in common.planned],
            with_intervals=len(stopped) < len(outcomes),
        ),
    )


def _of_fixed_runs(contrasts: Iterable[AnyContrast], stopped: Collection[str]) -> list[AnyContrast]:
    return [
        without_intervals(row) if row.first in stopped or row.second in stopped else row for row in contrasts
    ]


def _difference(difference: Difference) -> RunDifference:
    return RunDifference(field=difference.field, values=dict(difference.values))


def read_runs(paths: Sequence[Path]) -> dict[str, RunOutcomes]:
    """Read the runs in folders (or of ``pairs.jsonl`` files), named by their paths as given.

    Raises:
        ReportError: A run cannot be read, or is given twice.
    """
    repeated = [path for path, count in Counter(path.resolve() for path in paths).items() if count > 1]
    if repeated:
        raise ReportError(f"{str(repeated[0])!r} is given twice; a comparison is of different runs.")
    return {str(path): read_outcomes(path) for path in paths}


def _lowest_event(by_event: Mapping[str, Result]) -> LowestEvent:
    outcomes = {event: result.outcomes for event, result in by_event.items()}
    changes = {event: found.change.count / found.total for event, found in outcomes.items()}
    lowest = min(changes.values())
    chance = lowest_by_chance(
        [found.total for found in outcomes.values()],
        gains=sum(found.change_associated_success for found in outcomes.values()),
        losses=sum(found.regression for found in outcomes.values()),
        seen=lowest,
    )
    events = [event for event, change in changes.items() if change == lowest]
    named = len(events) == 1 and len(changes) > 1 and not chance.explains
    return LowestEvent(
        event=events[0] if named else None,
        value=float(f"{lowest:.12g}"),
        by_chance=float(f"{chance.expected:.12g}"),
    )


def _over_runs(changes: Sequence[float]) -> OverRuns:
    """Median, quartiles (linear between runs) and range of the paired changes of an event."""
    lowest, lower, median, upper, highest = (
        float(f"{value:.12g}") for value in np.percentile(changes, [0, 25, 50, 75, 100]).tolist()
    )
    return OverRuns(lowest=lowest, lower_quartile=lower, median=median, upper_quartile=upper, highest=highest)


_OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
assert _OUTCOMES == OUTCOMES


def _flips(common: CommonCases) -> list[Flip]:
    names = list(common.pairs)
    codes = np.stack([outcome_codes(pairs) for pairs in common.pairs.values()], axis=1)
    changed = np.flatnonzero((codes != codes[:, :1]).any(axis=1))
    flips: list[Flip] = []
    for index in changed.tolist():
        pair, outcomes = common.planned[index], [_OUTCOMES[code] for code in codes[index].tolist()]
        flips.append(
            Flip(case_id=pair.case_id, item_id=pair.item_id, outcomes=dict(zip(names, outcomes, strict=True)))
        )
    return flips


def outcome_codes(pairs: Pairs) -> NDArray[np.int64]:
    """Return the place of every pair's outcome in :data:`OUTCOMES`."""
    failed = 1 - pairs.dynamic.astype(np.int64)
    return np.where(pairs.base, 2 * failed, 1 + 2 * failed)
