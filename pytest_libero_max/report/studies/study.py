"""The part of a report that is about a study: computed from the records, like everything else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies.study_cadence import cadence_json
from pytest_libero_max.report.studies.study_camera import camera_json
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
    """What was executed, against what the same arms cost in two other ways.

    ``singly``: every arm by itself from the start. ``as_pairs``: every arm with an event in a pair with a
    Base of its own, as runs without a study would play it. Settle steps, and queries that were asked again
    to check the policy, are not counted.
    """
    ways = ("", "_singly", "_as_pairs")
    totals = {"arms": 0, **{what + way: 0 for what in ("steps", "queries") for way in ways}}
    for record in records:
        for name, arm in record.arms.items():
            base = record.arms.get(BASE + name.removeprefix(DYNAMIC), record.arm(BASE))
            totals["arms"] += 1
            for what, own in zip(("steps", "queries"), _own(arm), strict=True):
                totals[what] += own
                totals[f"{what}_singly"] += getattr(arm, what) or 0
                if arm.schedule:
                    totals[f"{what}_as_pairs"] += own + (getattr(base, what) or 0)
    return totals


def _own(arm: ArmRecord) -> tuple[int, int]:
    """Steps and queries that were executed for this arm alone: it parts from another at its first event."""
    if arm.shares is not None:
        return 0, 0
    first: Any = arm.firings[0] if arm.firings else None
    shared = (0, 0) if first is None else (first.step, first.queries)
    return (arm.steps or 0) - shared[0], (arm.queries or 0) - shared[1]
