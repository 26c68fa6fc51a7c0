"""Gates decided on a run's folder, and the text of their verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.report.comparison.compare import common_cases
from pytest_libero_max.report.comparison.comparison_document import SuccessContrast
from pytest_libero_max.report.comparison.contrasts import contrast_of
from pytest_libero_max.report.gate_reach import require_reachable, require_reachable_vs
from pytest_libero_max.report.gates import Gate, GateResult, evaluate_gate, require_known_groups
from pytest_libero_max.report.writers.report_files import REPORT_NAME, report_of
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME, StoredRun, read_pairs
from pytest_libero_max.stats.comparison import contrasts


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
        gates: Result of :func:`~pytest_libero_max.report.gates.parse_gates`.
        pairs: All pairs of the track or manifest, also those left out of the run.
        chosen: The pairs of the run.
        folder: Folder of the run, which may not exist yet.
        start: Folder that relative paths of other runs in the gates begin at.

    Raises:
        OptionError: A gate names a group that no pair is of, another run that cannot be read, or the run
            itself as the other one; or no outcome of its pairs meets it.
    """
    require_known_groups(gates, pairs)
    for gate in gates:
        if gate.run is None:
            require_reachable(gate, chosen)
            continue
        other = _folder(start / gate.run)
        if other.resolve() == _folder(folder).resolve():
            raise OptionError(
                f"gate={gate.text!r} compares the run with itself: {gate.run!r} is its own folder. Keep the "
                "other run elsewhere, or choose another output folder."
            )
        try:
            earlier = read_pairs(other)
        except ReportError as error:
            raise OptionError(
                f"gate={gate.text!r} compares with the run {gate.run!r}, which cannot be read: {error}"
            ) from error
        names = {pair.case_id for pair in chosen}
        require_reachable_vs(gate, [it.dynamic_success for it in earlier.records if it.case_id in names])


def decide(gates: Sequence[Gate], folder: Path, start: Path) -> tuple[GateResult, ...]:
    """Decide gates on the run in ``folder``.

    Args:
        gates: Result of :func:`~pytest_libero_max.report.gates.parse_gates`.
        folder: Folder of the run, or its ``pairs.jsonl``.
        start: Folder from which relative paths of other runs in the gates start.

    Raises:
        ReportError: The run itself cannot be read. Another run that cannot makes its gates undecidable.
    """
    stored = read_pairs(folder)
    report = report_of(stored)
    others = {gate.run for gate in gates if gate.run is not None}
    against = {other: _against(stored, start / other) for other in sorted(others)}
    return tuple(evaluate_gate(gate, report, against) for gate in gates)


def gate_lines(results: Sequence[GateResult]) -> list[str]:
    """Return the lines on gates for the terminal, one each."""
    marks = {"passed": "pass", "failed": "FAIL", "undecidable": "FAIL"}
    return [f"gate {marks[result.verdict]}  {result.reason}" for result in results]


def github_annotations(results: Sequence[GateResult]) -> list[str]:
    """Workflow commands that show gates which did not pass on a GitHub run."""
    return [
        f"::error title=LIBERO-MAX gate {result.verdict}::{_escaped(result.reason)}"
        for result in results
        if not result.passed
    ]


def _against(stored: StoredRun, other: Path) -> SuccessContrast | str:
    """Return the contrast of Dynamic success, the other run first; or why there is none."""
    try:
        baseline = read_pairs(_folder(other))
        common = common_cases({"baseline": baseline, "now": stored})
    except ReportError as error:
        return str(error)
    if common.partial:
        return f"it is a comparison on the {len(common.planned)} pairs that both policies support"
    outcomes = {name: pairs.dynamic for name, pairs in common.pairs.items()}
    (contrast,) = contrasts(outcomes, [pair.source for pair in common.planned])
    return contrast_of(contrast)


def _folder(path: Path) -> Path:
    """Return the folder of a run that may be named by one of its files."""
    return path.parent if path.name in (REPORT_NAME, PAIRS_NAME, PACKED_PAIRS_NAME) else path


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
