"""The other run of a gate: read, lined up with the run, and looked at for other settings."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.report.comparison.compare import common_cases
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gate_reach import require_reachable_vs
from pytest_libero_max.report.gates import Gate, GateResult
from pytest_libero_max.report.measurable import lack_of_run
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import REPORT_NAME
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
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME, StoredRun, pairs_file, read_pairs
from pytest_libero_max.stats.blocks import SuccessContrast
from pytest_libero_max.stats.comparison import contrasts


@dataclass(frozen=True)
class Baseline:
    """Another run beside the one that gates are decided on."""

    contrast: SuccessContrast
    """Contrast of Dynamic success, the other run first."""
    lost: tuple[str, ...]
    """Item ids of the pairs that only the other run completes."""
    differences: tuple[Difference, ...]
    """Settings in which the two differ beside their policies."""
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
