"""Camera timing and camera strength: rates, joint outcomes, contrasts and approach, from the records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies.study_document import (
    Approach,
    Camera,
    JointOutcome,
    LostInMiddle,
    LostInReset,
    ResetApproach,
)
from pytest_libero_max.stats.condition_blocks import (
    ConditionContrast,
)
from pytest_libero_max.stats.conditions import (
    Conditions,
    contrasts,
    contrasts_of_contrasts,
)
from pytest_libero_max.stats.outcome_table import BoolArray
from pytest_libero_max.studies.camera_study import CameraTiming, at_strength
from pytest_libero_max.studies.event_timing import RESET


def camera_results(study: CameraTiming, records: Sequence[PairRecord], tasks: Sequence[str]) -> Camera:
    """Compute everything that is reported of a camera study.

    Args:
        study: The study.
        records: Measured cases.
        tasks: The reference task of each.

    Raises:
        ReportError: A record lacks an arm of the study.
    """
    labels = condition_labels(study)
    conditions = Conditions.of(
        {arm: np.array([record.arm(arm).success for record in records], dtype=np.bool_) for arm in labels},
        [record.source for record in records],
        tasks,
        [record.configuration for record in records],
    )
    return Camera(
        conditions=labels,
        rates={arm: conditions.rate(arm) for arm in labels},
        outcomes=[
            JointOutcome(success=dict(zip(labels, flags, strict=True)), cases=count)
            for flags, count in conditions.joint().items()
        ],
        contrasts=list(contrasts(conditions, _pairs(study))),
        gap_contrasts=_gaps(study, conditions),
        approach={
            f"{share:g}": _approach(records, at_strength(RESET, share), at_strength(DYNAMIC, share))
            for share in study.strengths
        },
    )


def condition_labels(study: CameraTiming) -> dict[str, str]:
    """Return the titles of the conditions by arm: Base first, the strengths upwards."""
    labels = {BASE: "Base"}
    for share in study.strengths:
        end = f" {share:.0%}" if len(study.strengths) > 1 else ""
        labels |= {at_strength(RESET, share): f"Reset{end}", at_strength(DYNAMIC, share): f"Mid-task{end}"}
    return labels


def _pairs(study: CameraTiming) -> list[tuple[str, str]]:
    """Return the contrasts: within each strength, and of each timing between the strengths."""
    pairs = []
    for share in study.strengths:
        reset, middle = at_strength(RESET, share), at_strength(DYNAMIC, share)
        pairs += [(middle, reset), (reset, BASE), (middle, BASE)]
    for weak, strong in combinations(study.strengths, 2):
        pairs += [(at_strength(arm, strong), at_strength(arm, weak)) for arm in (RESET, DYNAMIC)]
    return pairs


def _gaps(study: CameraTiming, conditions: Conditions) -> list[ConditionContrast]:
    """Mid-task less Reset at one strength, less the same at another."""
    gap = {share: (at_strength(DYNAMIC, share), at_strength(RESET, share)) for share in study.strengths}
    pairs = list(combinations(study.strengths, 2))
    gaps = [(gap[strong], gap[weak]) for weak, strong in pairs]
    names = [(f"{strong:g}", f"{weak:g}") for weak, strong in pairs]
    return list(contrasts_of_contrasts(conditions, gaps, names))


def _approach(records: Sequence[PairRecord], reset_arm: str, middle_arm: str) -> Approach:
    """Count approaches of the hand to the trigger entity in Reset, and queries after Mid-task's event."""
    base = _flags(records, lambda record: record.arm(BASE).success)
    reset = _flags(records, lambda record: record.arm(reset_arm).success)
    middle = _flags(records, lambda record: record.arm(middle_arm).success)
    entered = _flags(records, lambda record: _entered(record, record.arm(reset_arm)))
    responded = _flags(records, lambda record: record.arm(middle_arm).response_step is not None)
    fresh = _flags(records, lambda record: record.arm(middle_arm).stale_actions == 0)
    kept_in_middle, kept_in_reset = base & middle & ~reset, base & reset & ~middle
    return Approach(
        triggered=sum(bool(record.arm(middle_arm).firings) for record in records),
        query_after_the_event=int(responded.sum()),
        reset=ResetApproach(
            failed_never_entered=int((~reset & ~entered).sum()),
            failed_entered=int((~reset & entered).sum()),
            succeeded_never_entered=int((reset & ~entered).sum()),
            succeeded_entered=int((reset & entered).sum()),
        ),
        base_and_middle_succeed_reset_fails=LostInReset(
            cases=int(kept_in_middle.sum()),
            reset_never_entered=int((kept_in_middle & ~entered).sum()),
        ),
        base_and_reset_succeed_middle_fails=LostInMiddle(
            cases=int(kept_in_reset.sum()),
            with_a_query_after_the_event=int((kept_in_reset & responded).sum()),
            without_stale_actions=int((kept_in_reset & responded & fresh).sum()),
        ),
    )


def _flags(records: Sequence[PairRecord], holds: Callable[[PairRecord], bool]) -> BoolArray:
    return np.array([holds(record) for record in records], dtype=np.bool_)


def _entered(record: PairRecord, arm: ArmRecord) -> bool:
    """Return True if the hand came within the distance of the case's trigger in an arm."""
    schedule = record.arm(DYNAMIC).schedule
    within_m: Any = schedule[0]["trigger"].get("distance_m") if schedule else None
    if not _is_distance(within_m):
        raise ReportError(
            f"{record.item_id} does not say what its event waits for, so it is of no camera study. Play it "
            "again."
        )
    return arm.min_distance_m <= float(within_m)


def _is_distance(value: object) -> bool:
    return type(value) in (int, float) and 0 <= value < float("inf")  # type: ignore[operator]
