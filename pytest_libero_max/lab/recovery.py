"""Recovery: runs of one policy with and without restoration of its images, on the same cases.

Intervals are pointwise, for independent cases. Beside them are the paper's: paired percentile bootstrap of
10,000 resamples, stratified by source category and clustered by configuration (task and initial state).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.comparison.compare import common_cases
from pytest_libero_max.report.document import Document, Section, Table, table_of
from pytest_libero_max.report.formats import Interval, Number, Share, Tenths
from pytest_libero_max.report.quantities import TEXT, Cell, Quantity
from pytest_libero_max.runs.agreement import policy_differences
from pytest_libero_max.runs.comparability import COMPARISON, differences_between
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats import blocks
from pytest_libero_max.stats.blocks import Block
from pytest_libero_max.stats.bounded_mean import bounded_means
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS, REPLICATES, cluster_bootstrap
from pytest_libero_max.stats.measured import ends, interval_of, number, ratio_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio

NATIVE, ALWAYS, GATED = MODES = ("native", "always", "gated")

_PREFIX = "restore="
_TIME = "restore_s"

Differences = NDArray[np.int64]


class Mode(Block, frozen=True, kw_only=True):
    """Results with one mode."""

    base: blocks.Ratio
    """Base success rate."""
    dynamic: blocks.Ratio
    """Dynamic success rate."""
    active: dict[str, blocks.Ratio | None]
    """Queries whose images were restored, of all, by arm; of Dynamic after the event. None: no count."""
    images: dict[str, dict[str, int] | None]
    """Counts of the wrapper that restores images, by arm and name."""
    seconds_per_query: float | None
    """Time of judging and restoring; None without a count."""


class Gain(Block, frozen=True, kw_only=True):
    """A quantity with one mode less that with another, over the same cases."""

    mode: str
    over: str
    """The mode that is subtracted."""
    quantity: str
    """dynamic, base or closure (the Dynamic gain less the Base gain)."""
    name: str = ""
    """Source or corruption of the cases; empty for all of them."""
    pairs: int
    gained: int
    """Cases in which the difference is above 0."""
    lost: int
    """Cases in which it is below 0."""
    value: float | None
    """Mean over the cases."""
    configurations: int
    """Tasks with an initial state, which are resampled whole."""
    changed_configurations: int
    """Those in which a case differs."""
    lower: float | None
    """Lower end of the 95% interval for independent cases: the melded exact one, and for a closure that of
    weighted means (Gaffke 2005)."""
    upper: float | None
    bootstrap: blocks.Interval
    """The paper's interval, clustered by configuration, for comparison with it; None at both ends where too
    little could vary."""


class Recovery(Block, frozen=True, kw_only=True):
    """Modes of restoration, compared on the same cases."""

    policy: dict[str, Any]
    """Spec of the policy as the native run played it."""
    substrate: str
    case_set: str
    common: int
    """Cases that every run has measured."""
    planned: int
    """Planned cases of the native run."""
    unsupported: dict[str, int]
    """By mode, number of planned cases that the policy does not support."""
    replicates: int
    """Resamples of a bootstrap interval."""
    modes: dict[str, Mode]
    effects: list[Gain]
    groups: list[Gain]
    """Dynamic gains by source, and by corruption."""


@dataclass(frozen=True)
class _Columns:
    """The common cases, one row a case: outcomes by mode and arm, and labels."""

    success: Mapping[tuple[str, str], Differences]
    category: NDArray[np.str_]
    configuration: NDArray[np.str_]

    def part(self, rows: NDArray[np.bool_]) -> _Columns:
        success = {key: values[rows] for key, values in self.success.items()}
        return _Columns(success, self.category[rows], self.configuration[rows])

    def gain(self, mode: str, arm: str, over: str = NATIVE) -> Differences:
        """(n,) success in an arm with one mode less that with another: -1, 0 or 1."""
        return self.success[mode, arm] - self.success[over, arm]

    def closure(self, mode: str) -> Differences:
        """Return (n,) the reduction of Base less Dynamic against native: -2 to 2."""
        return self.gain(mode, DYNAMIC) - self.gain(mode, BASE)


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
    measured = {mode: {record.case_id: record for record in run.records} for mode, run in by_mode.items()}
    records = {mode: [found[case_id] for case_id in ids] for mode, found in measured.items()}
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
    groups = (
        np.array([record.source for record in first]),
        np.array([_corruption(record) for record in first]),
    )
    others = [mode for mode in records if mode != NATIVE]
    policy = dict(first[0].policy)
    return Recovery(
        policy=policy,
        substrate=runs[0].run.provenance["substrate"]["name"],
        case_set=runs[0].run.provenance["case_set"]["name"],
        common=len(ids),
        planned=len(runs[0].run.planned),
        unsupported=dict(common.unsupported),
        replicates=REPLICATES,
        modes={mode: _mode(columns, mode, records[mode]) for mode in records},
        effects=[_effect(columns, *effect) for effect in _effects(others)],
        groups=[
            _effect(columns.part(labels == name), mode, NATIVE, "dynamic", name)
            for mode in others
            for labels in groups
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
            f"The runs have restore={', '.join(map(repr, found))}, but one must have none and another "
            "must. Play the track without --libero-max-wrap=restore:MODE as well, or with it."
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
    n = len(columns.category)
    base, dynamic = (ratio_of(Ratio(int(columns.success[mode, arm].sum()), n)) for arm in (BASE, DYNAMIC))
    notes = {arm: _notes(records, arm) for arm in (BASE, DYNAMIC)}
    active = {
        arm: ratio_of(Ratio(counts["active"], counts["queries"])) if counts else None
        for arm, counts in notes.items()
    }
    queries = sum(counts["queries"] for counts in notes.values() if counts)
    seconds = sum(record.timings.get(_TIME, 0.0) for record in records)
    each = number(seconds / queries) if queries else None
    return Mode(base=base, dynamic=dynamic, active=active, images=notes, seconds_per_query=each)


def _notes(records: Sequence[PairRecord], arm: str) -> dict[str, int] | None:
    """Return the counts of an arm that was played, summed; those of replayed prefixes are not in them."""
    counted = [record.arm(arm).notes for record in records if record.arm(arm).shares is None]
    held = [notes for notes in counted if notes is not None]
    return {name: sum(notes[name] for notes in held) for name in held[0]} if held else None


def _effects(others: Sequence[str]) -> list[tuple[str, str, str]]:
    rows = [
        (mode, NATIVE, quantity) for mode in reversed(others) for quantity in ("dynamic", "base", "closure")
    ]
    return [*rows, (GATED, ALWAYS, "dynamic")] if len(others) == 2 else rows


def _effect(columns: _Columns, mode: str, over: str, quantity: str, name: str = "") -> Gain:
    """Return a mean difference; the clustered interval is None where too little could vary."""
    closure = quantity == "closure"
    values = columns.closure(mode) if closure else columns.gain(mode, quantity, over)
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
    return Gain(
        mode=mode,
        over=over,
        quantity=quantity,
        name=name,
        pairs=len(values),
        gained=gained,
        lost=lost,
        value=number(float(values.mean())),
        configurations=configurations,
        changed_configurations=changed,
        lower=lower,
        upper=upper,
        bootstrap=interval_of(clustered),
    )


_QUANTITIES = {"dynamic": "Dynamic gain", "base": "Base gain", "closure": "Gap closure"}

_MODE: tuple[Quantity[Mode], ...] = (
    Quantity("base", "Base", lambda row: row.base, Share()),
    Quantity("dynamic", "Dynamic", lambda row: row.dynamic, Share()),
)

_GAIN: tuple[Quantity[Gain], ...] = (
    Quantity("gain", "pp", lambda row: row.value, Tenths()),
    Quantity("interval", "[95%]", lambda row: row, Interval()),
    Quantity("bootstrap", "bootstrap", lambda row: row.bootstrap, Interval()),
    Quantity("gained", "gained", lambda row: row.gained, TEXT),
    Quantity("lost", "lost", lambda row: row.lost, TEXT),
)

_NOTES = (
    "Gap closure is the Dynamic gain less the Base gain. Intervals: 95%, pointwise, for independent cases; "
    "the paper's bootstrap, stratified by source category and clustered by configuration, is too narrow "
    f"where few cases changed, and n/a with fewer than {LEAST_TASKS} configurations or fewer than "
    f"{LEAST_CHANGED_TASKS} in which a case changed.",
    "Times are of judging and restoring alone; they are no statement on the speed of an episode.",
)


def document_of(recovery: Recovery) -> Document:
    """Return a comparison of modes as a document."""
    policy = recovery.policy
    unsupported = max(recovery.unsupported.values(), default=0)
    left = f", {unsupported} of them unsupported by the policy" if unsupported else ""
    name = f"{policy['name']} (H={policy['horizon']} Q={policy['query_interval']})"
    modes = [
        (
            mode,
            *(one.cell(row) for one in _MODE),
            *(
                None if share is None else Cell(share, Share())
                for share in (row.active[BASE], row.active[DYNAMIC])
            ),
            None if row.seconds_per_query is None else Cell(1000 * row.seconds_per_query, Number(".1f")),
        )
        for mode, row in recovery.modes.items()
    ]
    head: list[str | Quantity[Mode]] = ["Mode", *_MODE, "Active, Base", "after the event", "ms a query"]
    effects = [(_effect_name(row), row) for row in recovery.effects]
    groups = [(f"{row.mode}, {row.name} ({row.pairs})", row) for row in recovery.groups]
    return Document(
        f"Recovery: {name} on {recovery.substrate}, {recovery.case_set}",
        texts=[f"{recovery.common} common cases of {recovery.planned} planned{left}"],
        sections=[
            Section(tables=[Table("", head, modes)]),
            Section(tables=[table_of("", "Effect", _GAIN, effects)]),
            Section(tables=[table_of("", "Dynamic gain by group", _GAIN, groups)]),
            Section(texts=_NOTES),
        ],
    )


def _effect_name(row: Gain) -> str:
    return f"{row.mode} - {row.over}: {_QUANTITIES[row.quantity]}"
