"""The report of results that another runner wrote (:mod:`.readers`), and their comparison with a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from msgspec import structs

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.report.build import (
    METHODS,
    counts_of,
    headline_of,
    missing_as_failures,
    outcome_groups,
    substrate_of,
)
from pytest_libero_max.report.gate_text import gate_rows
from pytest_libero_max.report.gates import Gate, GateResult, evaluate_gate
from pytest_libero_max.report.inference import inference_of
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.readers import ReadResults
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.statements import statements_of
from pytest_libero_max.report.writers.report_files import (
    HTML_NAME,
    MARKDOWN_NAME,
    REPORT_NAME,
    report_json,
    write_text,
)
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.stats.blocks import Result, SuccessContrast
from pytest_libero_max.stats.comparison import contrasts
from pytest_libero_max.stats.paired import Pairs, expose, measure


def report_of_results(results: ReadResults) -> Report:
    """Return the report of results as far as it follows from outcomes.

    Causes, times, films and everything else that takes a record is left out, and ``warnings`` say so.
    """
    planned = sorted(results.planned, key=lambda pair: pair.case_id)
    measured = [pair for pair in planned if pair.case_id in results.outcomes]
    rows = [results.outcomes[pair.case_id] for pair in measured]
    columns = Pairs.of(
        base=[row.base for row in rows],
        dynamic=[row.dynamic for row in rows],
        triggered=[row.triggered for row in rows],
        responded=[row.responded for row in rows],
        stale=[(row.stale or 0) if row.triggered else -1 for row in rows],
        source=[pair.source for pair in measured],
        task=[pair.task for pair in measured],
    )
    counts = counts_of(planned, results.outcomes.keys(), {})
    overall = measure(columns, len(planned))
    groups = outcome_groups(
        planned,
        measured,
        columns,
        {pair.case_id: (row.base, row.dynamic) for pair, row in zip(measured, rows, strict=True)},
    )
    if any(row.responded and row.stale is None for row in rows):
        overall = _without_exposure(overall)
        groups["by"] = {
            name: {label: _without_exposure(row) for label, row in by.items()}
            for name, by in groups["by"].items()
        }
    return Report(
        pairs=counts,
        selection=None,
        headline=headline_of(counts, overall),
        missing_as_failures=missing_as_failures(counts, overall.outcomes),
        policy=None,
        inference=inference_of([], results.provenance["protocol"]),
        substrate=substrate_of(results.provenance, planned),
        warnings=list(results.notes),
        caveats=[],
        overall=overall,
        clipped_actions=None,
        changed_pairs=[],
        causes={BASE: {}, DYNAMIC: {}},
        **groups,
        sections={},
        statements=statements_of(
            results.provenance["case_set"]["name"], [pair.case_id for pair in planned], with_intervals=True
        ),
        methods=dict(METHODS),
        provenance=results.provenance,
    )


def _without_exposure(row: Result) -> Result:
    return structs.replace(row, stale_actions=expose([], row.stale_actions.unanswered))


def contrast_with(results: ReadResults, run: RunOutcomes) -> SuccessContrast | str:
    """Return Dynamic success of a run less that of the results, or why there is none.

    It is over the common cases, which are those with the same digest.
    """
    own = dict(zip(run.case_ids, run.pairs.dynamic.tolist(), strict=True))
    digests = {pair.case_id: pair.case_digest for pair in run.run.planned}
    common = [
        pair.case_id
        for pair in results.planned
        if pair.case_id in own
        and pair.case_id in results.outcomes
        and digests[pair.case_id] == pair.case_digest
    ]
    if not common:
        return "no case of the run is a case of these results"
    there = np.array([results.outcomes[case].dynamic for case in common], dtype=np.bool_)
    here = np.array([own[case] for case in common], dtype=np.bool_)
    return contrasts({"results": there, "run": here})[0]


def decide_results(gates: Sequence[Gate], report: Report) -> tuple[GateResult, ...]:
    """Decide gates on results; one against another run compares records and cannot be decided."""
    why = "these results hold no records to compare with a run's; --beside compares outcomes"
    return tuple(evaluate_gate(gate, report, {} if gate.run is None else {gate.run: why}) for gate in gates)


def write_results(
    folder: Path, results: ReadResults, gates: Sequence[GateResult] = ()
) -> tuple[Report, list[Path]]:
    """Write ``report.json``, ``report.md`` and ``report.html`` beside results."""
    report = report_of_results(results)
    lost = sorted(
        pair.item_id
        for pair in results.planned
        if (row := results.outcomes.get(pair.case_id)) is not None and row.base > row.dynamic
    )
    texts = {
        REPORT_NAME: report_json(report),
        MARKDOWN_NAME: markdown(report, {}, gate_rows(gates)),
        HTML_NAME: html(report, lost, [], gates=gate_rows(gates)),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    return report, [folder / name for name in texts]
