"""Gates decided on a run's folder."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.report.comparison.compare import common_cases
from pytest_libero_max.report.connection import ARMS, can_connect, connect, lack_of_connection
from pytest_libero_max.report.formats import counted, points
from pytest_libero_max.report.gate_quantities import probe_of
from pytest_libero_max.report.gate_reach import require_reachable, require_reachable_vs
from pytest_libero_max.report.gates import (
    EQUIVALENT,
    SUCCESS_OF,
    Gate,
    GateResult,
    equivalence_interval,
    evaluate_gate,
    require_known_groups,
    shown,
)
from pytest_libero_max.report.measurable import lack_of_run
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import REPORT_NAME, report_of
from pytest_libero_max.runs.comparability import (
    COMPARISON,
    HERE,
    THERE,
    Difference,
    differences_between,
    listed,
    policies_text,
    policy_differences,
)
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME, StoredRun, pairs_file, read_pairs
from pytest_libero_max.stats.blocks import SuccessContrast
from pytest_libero_max.stats.comparison import contrasts
from pytest_libero_max.stats.intervals import Interval


@dataclass(frozen=True)
class Baseline:
    """Another run beside the one that gates are decided on."""

    contrast: SuccessContrast
    """Contrast of Dynamic success, the other run first."""
    lost: tuple[str, ...]
    """Item ids of the pairs that only the other run completes."""
    differences: tuple[Difference, ...]
    policies: str | None
    """Sentence on what differs between policies of one name; None where nothing is known to."""

    def refused(self, gate: Gate) -> str | None:
        """Return why the gate cannot be decided: differences that it does not allow; None for none."""
        rest = [one for one in self.differences if not one.accepted(gate.allow)]
        if not rest:
            return None
        names = "+".join(dict.fromkeys([*gate.allow, *(one.name for one in rest)]))
        return (
            f"this run and {gate.run!r} also differ in {listed(rest)}, so that a change is not of the policy "
            f"alone. Play both alike, or accept it with allow={names} behind the folder"
        )

    def differences_text(self, gate: Gate) -> str:
        """Return sentences on the differences that the gate allows, and on the policies; empty for none."""
        allowed = [one for one in self.differences if one.accepted(gate.allow)]
        accepted = f"Accepted: the runs also differ in {listed(allowed)}." if allowed else None
        return " ".join(filter(None, (accepted, self.policies)))


def read_baseline(stored: StoredRun, path: Path) -> Baseline | str | None:
    """Read the other run of a gate; None where there is none yet, a text where the two cannot be compared.

    Args:
        path: The other run: its folder, or one of its files.
    """
    folder = folder_of(path)
    if has_no_run(folder):
        return None
    try:
        other = read_pairs(folder)
        common = common_cases({THERE: other, HERE: stored})
    except ReportError as error:
        return str(error)
    if common.partial:
        return f"it is a comparison on the {counted(len(common.planned), 'pair')} that both policies support"
    outcomes = {name: pairs.dynamic for name, pairs in common.pairs.items()}
    (contrast,) = contrasts(outcomes, [pair.source for pair in common.planned])
    before, now = (outcomes[name] for name in (THERE, HERE))
    lost = [pair.item_id for pair, was, n in zip(common.planned, before, now, strict=True) if was and not n]
    sides = {name: RunOutcomes.of(run).side for name, run in ((THERE, other), (HERE, stored))}
    return Baseline(
        contrast,
        tuple(sorted(lost)),
        tuple(differences_between(sides, COMPARISON)),
        policies_text(one.field for one in policy_differences(sides)),
    )


def first_result(gate: Gate, stored: StoredRun, report: Report) -> GateResult:
    """Return the verdict on a gate with ``first=pass`` whose other run does not exist yet.

    It passes if this run can be the other one next time.
    """
    lack = lack_of_run(report)
    if not lack:
        try:
            require_reachable_vs(gate, [record.dynamic_success for record in stored.records])
        except OptionError as error:
            lack = f"against this run the gate would decide nothing next time: {error}"
    where = f"no baseline yet: there is no run in {gate.run!r}"
    if lack:
        return GateResult(gate, "undecidable", None, f"{where}, and this one cannot become it: {lack}.")
    detail = f"{where}, so that nothing was compared. Keep this run as the first one."
    return GateResult(gate, "passed", None, detail, no_baseline=True)


def has_no_run(folder: Path) -> bool:
    """Return True if a folder is missing or empty, so that no run has ever been there.

    A link that leads nowhere, and a name below a file or below a run, are mistakes and no missing run.
    """
    if os.path.lexists(folder):
        return folder.is_dir() and not any(folder.iterdir())
    above = next(parent for parent in folder.absolute().parents if os.path.lexists(parent))
    return above.is_dir() and not pairs_file(above).exists()


def folder_of(path: Path) -> Path:
    """Return the folder of a run that may be named by one of its files."""
    return path.parent if path.name in (REPORT_NAME, PAIRS_NAME, PACKED_PAIRS_NAME) else path


_OF_LOSSES = (
    *("delta", "delta.clustered", "preserved_success", "regressions"),
    *("conditional_regression", "retained", "given_response_dynamic_success", "given_response_paired_change"),
)
"""Quantities that a pair moves that Base completes and Dynamic does not."""


def require_usable(
    gates: Sequence[Gate],
    pairs: Iterable[PlannedPair],
    chosen: Sequence[PlannedPair],
    folder: Path,
    start: Path,
) -> None:
    """Refuse gates that could not be decided, or not be met, whatever a run measures.

    Called before anything is played.

    Args:
        pairs: All pairs of the track or manifest, also those left out of the run.
        start: Folder that relative paths of other runs in the gates begin at.

    Raises:
        OptionError: A gate names a group that no pair is of, another run that cannot be read, or the run
            itself as the other one; or no outcome of its pairs meets it.
    """
    require_known_groups(gates, pairs)
    require_open(gates, chosen)
    for gate in gates:
        if gate.run is None:
            continue
        other = folder_of(start / gate.run)
        if other.resolve() == folder_of(folder).resolve() or _same_file(
            pairs_file(other), pairs_file(folder)
        ):
            raise OptionError(
                f"gate={gate.text!r} compares the run with itself: {gate.run!r} is its own folder. Keep the "
                "other run elsewhere, or choose another output folder."
            )
        if gate.first and has_no_run(other):
            continue
        try:
            earlier = read_pairs(other)
        except ReportError as error:
            raise OptionError(
                f"gate={gate.text!r} compares with the run {gate.run!r}, which cannot be read: {error}"
            ) from error
        names = {pair.case_id for pair in chosen}
        require_reachable_vs(gate, [it.dynamic_success for it in earlier.records if it.case_id in names])


def require_watched(gates: Iterable[Gate], probes: Collection[str]) -> None:
    """Refuse gates on what a probe measures that is not asked for."""
    for gate in gates:
        probe = None if gate.run is not None else probe_of(gate.name)
        if probe is not None and probe not in probes:
            raise OptionError(
                f"gate={gate.text!r} is on what the probe {probe!r} measures, but this run does not ask for "
                f"it. Add --libero-max-probe={probe}."
            )


def require_open(gates: Iterable[Gate], chosen: Sequence[PlannedPair]) -> None:
    """Refuse gates on the run itself that every outcome of its pairs meets, or none."""
    for gate in gates:
        if gate.run is None:
            require_reachable(gate, chosen)


def require_connectable(gates: Iterable[Gate], run: Run) -> None:
    """Refuse gates against rows of the paper that a run cannot be held against, whatever it measures."""
    for gate in gates:
        if gate.row is None:
            continue
        lack = lack_of_connection(run.provenance, len(run.planned), gate.row)
        if lack is not None:
            raise OptionError(
                f"gate={gate.text!r} cannot compare this run with published results: {lack}. Play all of the "
                "authors' cases on genuine scenes, or leave the gate out."
            )
        if not can_connect(run.provenance, gate.row, ARMS[gate.name], float(gate.threshold)):
            raise OptionError(
                f"gate={gate.text!r} can never hold: the interval of "
                f"{counted(len(run.planned), 'case')} is wider, even at the published rate. "
                "Give a larger margin."
            )


def decide(gates: Sequence[Gate], folder: Path, start: Path) -> tuple[GateResult, ...]:
    """Decide gates on the run in ``folder``.

    Args:
        start: Folder from which relative paths of other runs in the gates start.

    Raises:
        ReportError: The run itself cannot be read. Another run that cannot makes its gates undecidable.
    """
    stored = read_pairs(folder)
    return decide_on(gates, stored, report_of(stored), start)


def decide_on(
    gates: Sequence[Gate], stored: StoredRun, report: Report, start: Path
) -> tuple[GateResult, ...]:
    """Decide gates on a run that has been read, and its report; see :func:`decide`."""
    if shards := shards_of(stored):
        why = f"libero-max shards merge decides it, on all {shards} shards."
        return tuple(GateResult(gate, "undecidable", None, why, waits=True) for gate in gates)
    others = {gate.run for gate in gates if gate.run is not None}
    baselines = {other: read_baseline(stored, start / other) for other in sorted(others)}
    return tuple(_decided(gate, stored, report, baselines.get(gate.run or "")) for gate in gates)


def shards_of(stored: StoredRun) -> int:
    """Return the number of shards of which a run is a part; 0 for a run that its gates are decided on."""
    selection = stored.run.provenance.get("selection")
    shards = None if selection is None else Selection.from_dict(selection).shards
    return 0 if shards is None else shards.of


def _decided(gate: Gate, stored: StoredRun, report: Report, baseline: Baseline | str | None) -> GateResult:
    if gate.first and baseline is None:
        return first_result(gate, stored, report)
    contrasts = {} if gate.run is None else {gate.run: _contrast(gate, baseline)}
    result = _by_rule(gate, report) or evaluate_gate(gate, report, contrasts)
    if result.verdict == "failed":
        not_shown, why = result.not_shown, ""
        if report.pairs.complete:
            not_shown, why = _why_an_end_fails(gate, report, contrasts)
        lost = baseline.lost if isinstance(baseline, Baseline) else _lost(stored, gate)
        result = replace(result, detail=f"{result.detail}{why}", lost=lost, not_shown=not_shown)
    if isinstance(baseline, Baseline) and result.verdict != "undecidable":
        result = replace(result, differences=baseline.differences_text(gate))
    return result


def _contrast(gate: Gate, baseline: Baseline | str | None) -> SuccessContrast | str:
    if baseline is None:
        return f"there is no run in {gate.run!r}; with first=pass the gate of a first run passes"
    if isinstance(baseline, str):
        return baseline
    return baseline.refused(gate) or baseline.contrast


def _by_rule(gate: Gate, report: Report) -> GateResult | None:
    """Return the verdict of the rule that stopped the run, which has watched the gate; None otherwise."""
    watched = report.pairs.stopped.watched if report.pairs.stopped else []
    for known in watched:
        if known.what == gate.text and known.verdict is not None:
            return GateResult(gate, known.verdict, None, known.detail, not_shown=known.not_shown)
    return None


def _why_an_end_fails(
    gate: Gate, report: Report, contrasts: Mapping[str, SuccessContrast | str]
) -> tuple[bool, str]:
    """Return whether a failed gate on the end of an interval is not shown by these pairs, and a sentence."""
    from pytest_libero_max.report.gate_plan import pairs_to_show

    if gate.row is not None:
        connection = connect(report, gate.row, ARMS[gate.name])
        return _why_no_equivalence(gate, None if isinstance(connection, str) else connection.interval)
    if gate.name == EQUIVALENT:
        other = contrasts[gate.run or ""]
        return _why_no_equivalence(gate, None if isinstance(other, str) else equivalence_interval(other))
    if gate.end is None:
        return False, ""
    other = "upper" if gate.end == "lower" else "lower"
    far, estimate = (evaluate_gate(replace(gate, end=end), report, contrasts) for end in (other, None))
    if far.value is None or estimate.value is None:
        return False, ""
    if not far.passed:
        return False, f" Violated: the {other} end, {shown(gate, far.value)}, does not meet it either."
    text = f" Not shown: the {other} end, {shown(gate, far.value)}, meets it"
    if not estimate.passed:
        return True, f"{text}, but the estimate, {shown(gate, estimate.value)}, does not."
    contrast = contrasts.get(gate.run or "")
    if isinstance(contrast, SuccessContrast):
        pairs, lost, gained = contrast.cases, contrast.first_only, contrast.second_only
    else:
        block = report.overall if gate.scope is None else report.by[gate.scope[0]][gate.scope[1]]
        pairs, outcomes = block.played, block.outcomes
        lost, gained = outcomes.regression, outcomes.change_associated_success
    needed = pairs_to_show(gate, pairs, lost / pairs, gained / pairs)
    more = (
        ""
        if needed is None
        else f"; at these rates of losses and gains, four of five runs of {counted(needed, 'pair')} show it"
    )
    return True, f"{text}, and so does the estimate, {shown(gate, estimate.value)}{more}."


def _why_no_equivalence(gate: Gate, interval: Interval | None) -> tuple[bool, str]:
    """As for an end: not shown where the interval of the difference reaches into the margin."""
    if interval is None:
        return False, ""
    ends = f"[{points(interval.lower)}, {points(interval.upper)}] points"
    if interval.lower < gate.threshold and interval.upper > -gate.threshold:
        return True, f" Not shown: a part of it, {ends}, lies within the margin."
    return False, f" Violated: all of it, {ends}, lies beyond the margin."


def _lost(stored: StoredRun, gate: Gate) -> tuple[str, ...]:
    """Pairs of a gate's scope that count against it, by item id: regressions, then failures of an arm."""
    if gate.name not in (*_OF_LOSSES, *SUCCESS_OF):
        return ()
    within = {pair.item_id for pair in gate.of_scope(stored.run.planned)}
    success = SUCCESS_OF.get(gate.name)
    against = [
        (record.outcome != "regression", record.item_id)
        for record in stored.records
        if record.item_id in within
        and (record.outcome == "regression" if success is None else not getattr(record, success))
    ]
    return tuple(name for _, name in sorted(against))


def _same_file(one: Path, other: Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)
