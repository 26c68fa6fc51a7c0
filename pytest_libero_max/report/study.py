"""The part of a report that is about a study: computed from the records, like everything else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.statistics_json import number
from pytest_libero_max.report.study_cadence import cadence_json
from pytest_libero_max.report.study_camera import camera_json
from pytest_libero_max.studies.cadence import CadenceSweep
from pytest_libero_max.studies.camera import CameraTiming
from pytest_libero_max.studies.registry import study_from_dict


def study_json(records: Sequence[PairRecord], tasks: Sequence[str], protocol: Json) -> Json | None:
    """What a study has found; None where the run was of none.

    Args:
        records: Measured cases, in the order of the report.
        tasks: The reference task of each.
        protocol: Of the header of the run.

    Raises:
        ReportError: A record lacks an arm of the study, or the study is not known.
    """
    if protocol.get("study") is None:
        return None
    study = study_from_dict(protocol["study"])
    found: Json = {}
    if isinstance(study, CameraTiming):
        found = camera_json(study, records, tasks)
    elif isinstance(study, CadenceSweep):
        found = cadence_json(study, records)
    return {
        "name": study.name,
        "title": study.title,
        "cases": len(records),
        **found,
        "executed": executed_json(records),
    }


def executed_json(records: Sequence[PairRecord]) -> Json:
    """What was executed, against every arm by itself from the start and against pairs with a Base each.

    Settle steps, and queries that were asked again to check the policy, are not counted.
    """
    totals = {"arms": 0, "steps": 0, "steps_singly": 0, "queries": 0, "queries_singly": 0}
    for record in records:
        for arm in record.arms.values():
            steps, queries = _own(arm)
            totals["arms"] += 1
            totals["steps"] += steps
            totals["queries"] += queries
            totals["steps_singly"] += arm.steps or 0
            totals["queries_singly"] += arm.queries or 0
    saved = {
        f"{what}_saved": number(
            1 - totals[what] / totals[f"{what}_singly"] if totals[f"{what}_singly"] else None
        )
        for what in ("steps", "queries")
    }
    return {**totals, **saved}


def _own(arm: ArmRecord) -> tuple[int, int]:
    """Steps and queries that were executed for this arm alone: it parts from another at its first event."""
    if arm.shares is not None:
        return 0, 0
    first: Any = arm.firings[0] if arm.firings else None
    shared = (0, 0) if first is None else (first.step, first.queries)
    return (arm.steps or 0) - shared[0], (arm.queries or 0) - shared[1]
