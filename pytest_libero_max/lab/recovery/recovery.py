"""Recovery: runs of one policy with and without restoration of its images, on the same cases.

Intervals are pointwise, for independent cases. Beside them are the paper's: paired percentile bootstrap of
10,000 resamples, stratified by source category and clustered by configuration (task and initial state).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.lab.recovery.recovery_document import (
    ActiveShares,
    CommonCases,
    Effect,
    Group,
    ImageNotes,
    Mode,
    Recovery,
)
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.comparison.compare import common_cases
from pytest_libero_max.runs.agreement import policy_differences
from pytest_libero_max.runs.comparability import COMPARISON, differences_between
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.stats.bounded_mean import bounded_means
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS, REPLICATES, cluster_bootstrap
from pytest_libero_max.stats.measured import ends, interval_of, number, ratio_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio

NATIVE, ALWAYS, GATED = MODES = ("native", "always", "gated")

_PREFIX = "restore="
_TIME = "restore_s"

Differences = NDArray[np.int64]


@dataclass(frozen=True)
class _Columns:
    """The common cases, one row a case: outcomes by mode and arm, and labels."""

    success: Mapping[tuple[str, str], Differences]
    category: NDArray[np.str_]
    configuration: NDArray[np.str_]

    def gain(self, mode: str, arm: str, over: str = NATIVE) -> Differences:
        """(n,) success in an arm with one mode less that with another: -1, 0 or 1."""
        return self.success[mode, arm] - self.success[over, arm]

    def closure(self, mode: str) -> Differences:
        """Return (n,) the reduction of Base less Dynamic against native: -2 to 2."""
        return self.gain(mode, DYNAMIC) - self.gain(mode, BASE)


def recovery_of(folders: Sequence[Path], restrict: bool = False) -> Recovery:
    """Compare the runs in some folders; see :func:`compare_recovery`.

    Raises:
        ReportError: A run cannot be read, or see there.
    """
    return compare_recovery([read_pairs(folder) for folder in folders], restrict)


def compare_recovery(runs: Sequence[StoredRun], restrict: bool = False) -> Recovery:
    """Compare runs of one policy that differ in the wrapper ``restore`` alone, one of them native.

    Args:
        runs: Two or three, in any order.
        restrict: Compare the common cases where the runs have different ones, instead of refusing.

    Raises:
        ReportError: Two runs have one mode, none is native, the policies differ, a rule stopped a run, a run
            holds pairs of another event than sensor noise, or the cases do not agree
            (:func:`~pytest_libero_max.report.comparison.compare.common_cases`).
    """
    by_mode = _by_mode(runs)
    if any(run.stopped_by_rule for run in runs):
        raise ReportError(
            "A rule stopped one of the runs, but the intervals of recovery are for a number of pairs that is "
            "fixed before. Resume it without --libero-max-stop, or play it again."
        )
    common = common_cases(by_mode, restrict)
    ids = [pair.case_id for pair in common.planned]
    records = {mode: _records(run, ids) for mode, run in by_mode.items()}
    first = records[NATIVE]
    _require_sensor_noise(first)
    columns = _Columns(
        success={
            (mode, arm): np.array([record.arm(arm).success for record in found], dtype=np.int64)
            for mode, found in records.items()
            for arm in (BASE, DYNAMIC)
        },
        category=np.array([f"{record.source}|{record.source_category}" for record in first]),
        configuration=np.array([record.configuration for record in first]),
    )
    groups = {
        "source": np.array([record.source for record in first]),
        "corruption": np.array([_corruption(record) for record in first]),
    }
    others = [mode for mode in records if mode != NATIVE]
    policy = dict(first[0].policy)
    return Recovery(
        policy=policy,
        substrate=runs[0].run.provenance["substrate"]["name"],
        case_set=runs[0].run.provenance["case_set"]["name"],
        pairs=CommonCases(
            common=len(ids),
            planned=len(runs[0].run.planned),
            unsupported=dict(common.unsupported),
        ),
        replicates=REPLICATES,
        modes={mode: _mode(columns, mode, records[mode]) for mode in records},
        effects=[_effect(columns, *effect) for effect in _effects(others)],
        groups=[
            _group(columns, mode, kind, name, labels == name)
            for mode in others
            for kind, labels in groups.items()
            for name in sorted(set(labels.tolist()))
        ],
    )


def _by_mode(runs: Sequence[StoredRun]) -> dict[str, StoredRun]:
    found: dict[str, StoredRun] = {}
    specs: list[Json] = []
    for run in runs:
        if not run.records:
            raise ReportError("A run has no measured pair, so it is not known how its images were restored.")
        spec = dict(run.records[0].policy)
        words = [text for text in spec.get("wrappers", ()) if text.startswith(_PREFIX)]
        mode = words[0].removeprefix(_PREFIX) if words else NATIVE
        spec["wrappers"] = [text for text in spec.get("wrappers", ()) if text not in words]
        if mode in found:
            raise ReportError(
                f"Two runs have restore={mode!r}. Give one of each; they differ in that option alone."
            )
        found[mode] = run
        specs.append(spec)
    if NATIVE not in found or len(found) < 2:
        raise ReportError(
            f"The runs have restore={', '.join(map(repr, found))}, but one must be native and another "
            "not. Play the track without --libero-max-wrap=restore:MODE as well, or with it."
        )
    if any(policy_differences(specs[0], spec) for spec in specs):
        raise ReportError(
            "The runs are of different policies or settings. Play one policy without a wrapper and with "
            "--libero-max-wrap=restore:always or restore:gated."
        )
    by_mode = {mode: found[mode] for mode in MODES if mode in found}
    sides = {mode: RunOutcomes.of(run).side for mode, run in by_mode.items()}
    others = [one.name for one in differences_between(sides, COMPARISON) if one.name != "wrappers"]
    if others:
        raise ReportError(
            f"The runs also differ in {', '.join(others)}, but recovery is of restore alone. Play them alike."
        )
    return by_mode


def _records(run: StoredRun, ids: Sequence[str]) -> list[PairRecord]:
    by_id = {record.case_id: record for record in run.records}
    return [by_id[case_id] for case_id in ids]


def _require_sensor_noise(records: Sequence[PairRecord]) -> None:
    other = sorted({record.event for record in records} - {"sensor_noise_onset"})
    if other:
        raise ReportError(
            f"The runs hold pairs of {', '.join(other)}, but recovery is about "
            "sensor_noise_onset. Play the track recovery, or another with -m sensor_noise_onset."
        )


def _corruption(record: PairRecord) -> str:
    from pytest_libero_max.events.kinds.sensor_noise_onset import CORRUPTIONS

    noise, covered = CORRUPTIONS[record.variant]
    return f"noise {noise:g}, mask {covered:.0%}"


def _mode(columns: _Columns, mode: str, records: Sequence[PairRecord]) -> Mode:
    """Return the rates of a mode, its activity, and its cost."""
    n = len(columns.category)
    rates = {arm: ratio_of(Ratio(int(columns.success[mode, arm].sum()), n)) for arm in (BASE, DYNAMIC)}
    notes = {arm: _notes(records, arm) for arm in (BASE, DYNAMIC)}
    queries = sum(counts["queries"] for counts in notes.values() if counts)
    seconds = sum(record.timings.get(_TIME, 0.0) for record in records)
    active = {
        arm: ratio_of(Ratio(counts["active"], counts["queries"])) if counts else None
        for arm, counts in notes.items()
    }
    return Mode(
        base=rates[BASE],
        dynamic=rates[DYNAMIC],
        active=ActiveShares(base=active[BASE], dynamic=active[DYNAMIC]),
        images=ImageNotes(base=notes[BASE], dynamic=notes[DYNAMIC]),
        seconds_per_query=number(seconds / queries) if queries else None,
    )


def _notes(records: Sequence[PairRecord], arm: str) -> dict[str, int] | None:
    """Return the counts of an arm that was played, summed; those of replayed prefixes are not in them."""
    counted = [record.arm(arm).notes for record in records if record.arm(arm).shares is None]
    held = [notes for notes in counted if notes is not None]
    return {name: sum(notes[name] for notes in held) for name in held[0]} if held else None


def _effects(others: Sequence[str]) -> list[tuple[str, str, str]]:
    """Return the mode, the mode it is compared with, and the quantity of each effect."""
    rows = [
        (mode, NATIVE, quantity) for mode in reversed(others) for quantity in ("dynamic", "base", "closure")
    ]
    return [*rows, (GATED, ALWAYS, "dynamic")] if len(others) == 2 else rows


def _effect(columns: _Columns, mode: str, over: str, quantity: str) -> Effect:
    closure = quantity == "closure"
    values = columns.closure(mode) if closure else columns.gain(mode, quantity, over)
    return Effect(mode=mode, over=over, quantity=quantity, **_gain(columns, values, closure=closure))


def _group(columns: _Columns, mode: str, kind: str, name: str, rows: NDArray[np.bool_]) -> Group:
    """Return the gain in Dynamic within a group of cases."""
    part = _Columns(
        {key: values[rows] for key, values in columns.success.items()},
        columns.category[rows],
        columns.configuration[rows],
    )
    values = part.gain(mode, DYNAMIC)
    native, restored = (
        ratio_of(Ratio(int(part.success[which, DYNAMIC].sum()), len(values))) for which in (NATIVE, mode)
    )
    return Group(
        mode=mode,
        kind=kind,
        name=name,
        native=native,
        restored=restored,
        **_gain(part, values, closure=False),
    )


def _gain(columns: _Columns, values: Differences, *, closure: bool) -> dict[str, Any]:
    """Return the fields of a mean difference; the clustered interval is None where too little could vary."""
    gained, lost = int((values > 0).sum()), int((values < 0).sum())
    configurations = len(np.unique(columns.configuration))
    changed = len(np.unique(columns.configuration[values != 0]))
    clustered = None
    if configurations >= LEAST_TASKS and changed >= LEAST_CHANGED_TASKS:
        clustered = cluster_bootstrap(
            values,
            columns.configuration,
            strata=columns.category,
            pools=columns.category,
            replicates=REPLICATES,
        )
    (interval,) = (
        bounded_means([values], largest=2) if closure else paired_differences([(lost, gained, len(values))])
    )
    lower, upper = ends(interval)
    return {
        "pairs": len(values),
        "gained": gained,
        "lost": lost,
        "value": number(float(values.mean())),
        "configurations": configurations,
        "changed_configurations": changed,
        "lower": lower,
        "upper": upper,
        "bootstrap": interval_of(clustered),
    }
