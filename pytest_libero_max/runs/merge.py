"""Merging the runs of one measurement: shards played on several machines, or resumed runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection, merged_selection
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.runs.agreement import SamePlay
from pytest_libero_max.runs.comparability import declare_weights, measurement_differences
from pytest_libero_max.runs.lock import read_mark
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import PairStore, StoredRun, pairs_file, read_pairs

_MAY_DIFFER: Json = {"platform": {}, "fingerprint": None, "gl_backend": None, "git": None, "command": []}
"""Parts of the provenance that may differ between runs of one measurement, and their merged values."""


def merge_runs(runs: Mapping[str, StoredRun]) -> StoredRun:
    """Join runs of one measurement. The result is the same whatever order they are given in.

    The planned pairs are those of all runs together. A pair that one run measured and another could not is
    measured, unless it was refused for what the policy did. Where a shard is missing the result says which
    one, and is incomplete. So is one of runs that stopped early, also by a rule, which decided on its own run
    alone; the result says which ones did.

    Raises:
        ReportError: Fewer than two runs, and not a single shard; they differ in policy, substrate, case set,
            protocol or versions, or in something else that changes results; they are shards of different
            divisions; or a pair was measured in two of them.
    """
    if not runs:
        raise ReportError("No run given, but merging takes two or more.")
    first_name, first = next(iter(runs.items()))
    if len(runs) < 2 and not (first.run.provenance.get("selection") or {}).get("shards"):
        raise ReportError("1 run given that is no shard, but merging takes two or more.")
    planned: dict[str, PlannedPair] = {}
    records: dict[str, tuple[str, PairRecord]] = {}
    errors: dict[str, PairError] = {}
    same_play = SamePlay()
    for name, run in runs.items():
        declared = declare_weights((*run.records, *first.records))
        different = measurement_differences(run.run, first.run, declared=declared)
        if different:
            raise ReportError(
                f"{name!r} and {first_name!r} are not pieces of one measurement: {'; '.join(different)}. "
                "Compare them instead."
            )
        for pair in run.run.planned:
            if planned.setdefault(pair.case_id, pair) != pair:
                raise ReportError(
                    f"case_id={pair.case_id!r} of {name!r} is another case than in an earlier run."
                )
        for record in run.records:
            if record.case_id in records:
                raise ReportError(
                    f"case_id={record.case_id!r} was measured in {records[record.case_id][0]!r} and in "
                    f"{name!r}; a case counts once. Leave one of the runs out."
                )
            same_play.add(record)
            records[record.case_id] = name, record
        for error in run.errors:
            known = errors.setdefault(error.case_id, error)
            errors[error.case_id] = min(
                known, error, key=lambda error: (not error.refused, error.phase, error.message)
            )
    refused = {error.case_id for error in errors.values() if error.refused}
    records = {case_id: known for case_id, known in records.items() if case_id not in refused}
    stops = [f"{name} was {run.stopped.text}" for name, run in sorted(runs.items()) if run.stopped]
    return StoredRun(
        run=Run(tuple(planned[case_id] for case_id in sorted(planned)), _provenance(runs, planned)),
        records=tuple(records[case_id][1] for case_id in sorted(records)),
        errors=tuple(errors[case_id] for case_id in sorted(errors) if case_id not in records),
        torn=False,
        stopped=Stopped("; ".join(stops), len(planned)) if stops else None,
    )


def finished(paths: Iterable[Path]) -> tuple[list[Path], list[str]]:
    """Return the folders whose run has ended, and messages about the others, or raise ReportError."""
    ended, said = [], []
    for path in paths:
        if not pairs_file(path).is_file():
            said.append(f"Left out {path}: no run has begun there.")
        elif path.is_dir() and read_mark(path) is not None:
            said.append(f"Left out {path}: its run has not ended.")
        else:
            ended.append(path)
    if not ended:
        raise ReportError(" ".join([*said, "So there is nothing to merge yet."]))
    return ended, said


def merge_folders(paths: list[Path], output: Path) -> StoredRun:
    """Join the runs at ``paths`` and write the whole as a run into ``output``."""
    merged = merge_runs({str(path): read_pairs(path) for path in paths})
    store = PairStore(output, merged.run)
    store.begin()
    pairs: list[PairRecord | PairError] = [*merged.records, *merged.errors]
    for pair in pairs:
        store.append(pair)
    store.close(merged.stopped)
    return merged


def _provenance(runs: Mapping[str, StoredRun], planned: Iterable[str]) -> Json:
    parts = [run.run.provenance for run in runs.values()]
    merged = dict(parts[0])
    for key, unknown in _MAY_DIFFER.items():
        if any(part.get(key) != parts[0].get(key) for part in parts):
            merged[key] = unknown
    if "started" in merged:
        merged["started"] = min(part.get("started") or merged["started"] for part in parts)
    for name in ("selection", "order", "stopping_rule"):  # the pieces were played beside each other
        merged.pop(name, None)
    policies = [part["policy"] for part in parts]
    if any(policy != policies[0] for policy in policies):
        merged["policy"] = _over_all_servers(policies)
    gates = sorted({gate for part in parts for gate in part.get("gates") or ()})
    merged |= {"gates": gates} if gates else {}
    selections = [part["selection"] for part in parts if "selection" in part]
    if len(selections) == len(parts):
        merged["selection"] = merged_selection(list(map(Selection.from_dict, selections)), planned).to_dict()
    return merged


def _over_all_servers(policies: Iterable[Json]) -> Json:
    """Return the policy of runs that were played over several addresses; their order does not matter."""
    ordered = sorted(policies, key=lambda policy: str(policy["reference"]))
    merged = dict(ordered[0])
    references = dict.fromkeys(str(policy["reference"]) for policy in ordered)
    if len(references) > 1:
        merged["reference"] = ",".join(references)
        merged.pop("servers", None)  # each record names its own
    return merged
