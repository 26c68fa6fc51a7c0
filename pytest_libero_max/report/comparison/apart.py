"""Runs that a comparison lists apart: those whose policies play a part of what the others play."""

from __future__ import annotations

from collections.abc import Mapping

from pytest_libero_max.report.comparison.comparison_document import ApartRun
from pytest_libero_max.report.comparison.run_notes import run_caveats, run_warnings
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import unsupported_pairs
from pytest_libero_max.stats.breakdown import breakdown
from pytest_libero_max.stats.measured import without_intervals
from pytest_libero_max.stats.paired import measure

Runs = dict[str, RunOutcomes]


def set_apart(runs: Mapping[str, RunOutcomes]) -> tuple[Runs, Runs]:
    """Return the runs to compare, and those to list apart.

    A run is listed apart if its policy declares that it does not support a suite whose cases the policy of
    another run supports: its own cases would then cut those of all others. Where fewer than two runs would
    be left, none is listed apart.

    Args:
        runs: Runs by the name they get in the comparison.
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
