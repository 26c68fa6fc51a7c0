"""Several runs on the same cases: who succeeds where, and which cases changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import columns_of, substrate_json
from pytest_libero_max.report.run import PlannedPair
from pytest_libero_max.report.statistics_json import change_json, contrast_json, number, result_json
from pytest_libero_max.report.store import StoredRun, read_pairs
from pytest_libero_max.stats.breakdown import breakdown
from pytest_libero_max.stats.comparison import contrasts, profile_agreement, ranks
from pytest_libero_max.stats.paired import measure

COMPARISON_VERSION = 2


@dataclass(frozen=True)
class CommonCases:
    """The cases several runs share, in one order.

    Attributes:
        planned: The common cases, by case id.
        records: For each run, their records in that order.
        left_out: For each run, its planned cases that are not compared.
    """

    planned: tuple[PlannedPair, ...]
    records: Mapping[str, tuple[PairRecord, ...]]
    left_out: Mapping[str, tuple[str, ...]]


def common_cases(runs: Mapping[str, StoredRun], restrict: bool = False) -> CommonCases:
    """Line up the cases that every run has measured.

    Args:
        runs: Runs by the name they get in the comparison.
        restrict: Compare what is common where the runs differ, instead of refusing.

    Raises:
        ReportError: Fewer than two runs, runs of different substrates or different cases of one name, no
            common case, or runs that differ in their cases without ``restrict``.
    """
    if len(runs) < 2:
        raise ReportError(f"{len(runs)} run given, but a comparison is of two or more.")
    substrates = sorted({run.run.provenance["substrate"]["name"] for run in runs.values()})
    if len(substrates) > 1:
        raise ReportError(
            f"The runs are of the substrates {' and '.join(substrates)}, whose scores are not comparable. "
            "Compare runs of one substrate."
        )
    records = {name: {record.case_id: record for record in run.records} for name, run in runs.items()}
    planned = {pair.case_id: pair for run in runs.values() for pair in run.run.planned}
    for name, run in runs.items():
        for pair in run.run.planned:
            if pair.case_digest != planned[pair.case_id].case_digest:
                raise ReportError(
                    f"case_id={pair.case_id!r} of run {name!r} is another case than in the other runs: the "
                    "manifests differ. Play both with the same manifest."
                )
    common = sorted(set.intersection(*(set(measured) for measured in records.values())))
    left_out = {
        name: tuple(sorted({pair.case_id for pair in run.run.planned} - set(common)))
        for name, run in runs.items()
    }
    if not common:
        raise ReportError("The runs have no measured case in common; there is nothing to compare.")
    if not restrict and any(left_out.values()):
        counts = ", ".join(f"{len(cases)} of {name!r}" for name, cases in left_out.items())
        raise ReportError(
            f"The runs do not share all cases: left out would be {counts}. Play the missing pairs, or "
            f"restrict the comparison to the {len(common)} common cases."
        )
    return CommonCases(
        planned=tuple(planned[case_id] for case_id in common),
        records={name: tuple(records[name][case_id] for case_id in common) for name in runs},
        left_out=left_out,
    )


def compare_runs(runs: Mapping[str, StoredRun], restrict: bool = False) -> Json:
    """Compare runs on their common cases.

    Contrasts are of Dynamic success, all pairs of runs, with Holm's correction over them; flips are the
    cases whose pair of outcomes differs between runs.

    Raises:
        ReportError: See :func:`common_cases`.
    """
    common = common_cases(runs, restrict)
    events = [event for event in EVENTS if any(pair.event == event for pair in common.planned)]
    labels = [pair.event for pair in common.planned]
    columns = {name: columns_of(rows) for name, rows in common.records.items()}
    results = {name: measure(column) for name, column in columns.items()}
    by_event = {name: breakdown(column, labels, events) for name, column in columns.items()}
    changes = {
        name: [group.outcomes.change.count / group.outcomes.total for group in groups.values()]
        for name, groups in by_event.items()
    }
    agreement = profile_agreement(changes)
    ranked = ranks({name: result.outcomes.dynamic.value for name, result in results.items()})
    rows = []
    for name, result in results.items():
        block = result_json(result, len(common.planned))
        rows.append(
            {
                "name": name,
                "rank": ranked[name],
                "policy": common.records[name][0].policy,
                "replay": replay_command(runs[name]),
                **{key: block[key] for key in _RUN_COLUMNS},
                "by_event": {event: change_json(group) for event, group in by_event[name].items()},
            }
        )
    return {
        "schema_version": COMPARISON_VERSION,
        "pairs": {
            "common": len(common.planned),
            "restricted": any(common.left_out.values()),
            "left_out": {name: list(cases) for name, cases in common.left_out.items()},
        },
        "substrate": substrate_json(next(iter(runs.values())).run.provenance["substrate"]["name"]),
        "runs": rows,
        "contrasts": [
            contrast_json(contrast)
            for contrast in contrasts(
                {name: column.dynamic for name, column in columns.items()},
                [pair.source for pair in common.planned],
            )
        ],
        "event_profiles": {
            "mean_spearman": number(agreement.mean),
            "lowest": number(agreement.lowest),
            "highest": number(agreement.highest),
        },
        "flips": _flips(common),
    }


def compare_folders(paths: Sequence[Path], restrict: bool = False) -> Json:
    """Compare the runs in folders (or of ``pairs.jsonl`` files), named by their paths as given.

    Raises:
        ReportError: A run cannot be read, or see :func:`common_cases`.
    """
    repeated = [path for path, count in Counter(paths).items() if count > 1]
    if repeated:
        raise ReportError(f"{str(repeated[0])!r} is given twice; a comparison is of different runs.")
    return compare_runs({str(path): read_pairs(path) for path in paths}, restrict)


_RUN_COLUMNS = (
    "base_success",
    "dynamic_success",
    "paired_change",
    "outcomes",
    "conditional_regression",
    "trigger_coverage",
    "response_coverage",
)


def replay_command(run: StoredRun) -> list[str]:
    """The command that plays one case of a run again, once the case's item id is appended."""
    provenance = run.run.provenance
    command = ["pytest", f"--libero-max-policy={provenance['policy']['reference']}"]
    kind, _, name = provenance["case_set"]["name"].partition(" ")
    if kind in ("track", "manifest") and name:
        command.append(f"--libero-max-{kind}={name}")
    for key, flag in (("horizon", "horizon"), ("query_interval", "query-interval")):
        if provenance["policy"].get(key) is not None:
            command.append(f"--libero-max-{flag}={provenance['policy'][key]}")
    return [*command, "-k"]


def _flips(common: CommonCases) -> list[Json]:
    flips: list[Json] = []
    names = list(common.records)
    for index, pair in enumerate(common.planned):
        outcomes: dict[str, Any] = {name: common.records[name][index].outcome for name in names}
        if len(set(outcomes.values())) > 1:
            flips.append(
                {
                    "case_id": pair.case_id,
                    "item_id": pair.item_id,
                    "outcomes": outcomes,
                }
            )
    return flips
