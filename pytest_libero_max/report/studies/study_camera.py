"""Camera timing and camera strength: rates, joint outcomes, contrasts and approach, from the records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from msgspec.structs import asdict
from numpy.typing import NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies import study_document
from pytest_libero_max.report.studies.study_document import (
    Approach,
    Camera,
    ConditionContrast,
    ConditionRate,
    JointOutcome,
    LostInMiddle,
    LostInReset,
    Mean,
    ResetApproach,
    SourceRate,
)
from pytest_libero_max.stats.conditions import (
    Conditions,
    Contrast,
    GroupInterval,
    MeanDifference,
    contrasts,
    contrasts_of_contrasts,
)
from pytest_libero_max.stats.intervals import MeanChange, mean_change
from pytest_libero_max.stats.measured import bootstrap_of, ends, number, rate_of
from pytest_libero_max.stats.outcome_table import BoolArray
from pytest_libero_max.stats.ratios import Ratio
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
    pairs = _pairs(study)
    return Camera(
        conditions=labels,
        rates={arm: _rate(conditions, arm) for arm in labels},
        outcomes=[
            JointOutcome(success=dict(zip(labels, flags, strict=True)), cases=count)
            for flags, count in conditions.joint().items()
        ],
        contrasts=[
            _contrast(first, second, found)
            for (first, second), found in zip(pairs, contrasts(conditions, pairs), strict=True)
        ],
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
    found = contrasts_of_contrasts(conditions, [(gap[other], gap[one]) for one, other in pairs])
    return [_contrast(f"{other:g}", f"{one:g}", row) for (one, other), row in zip(pairs, found, strict=True)]


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


def _rate(conditions: Conditions, arm: str) -> ConditionRate:
    """Return a success rate with the paper's source-stratified interval, and the same within each source."""
    successes, sources = conditions.successes[arm].astype(np.int64), conditions.source
    by_source = {
        name: SourceRate(**_counted(successes[sources == name], mean_change(successes[sources == name])))
        for name in conditions.sources
    }
    return ConditionRate(**_counted(successes, conditions.rate(arm)), by_source=by_source)


def _counted(successes: NDArray[np.int64], bootstrap: MeanChange | None) -> dict[str, Any]:
    """Return the fields of a rate with its exact interval and the paper's."""
    rate = rate_of(Ratio(int(successes.sum()), len(successes)))
    return {**asdict(rate), "bootstrap": bootstrap_of(bootstrap)}


def _contrast(first: str, second: str, found: Contrast) -> ConditionContrast:
    return ConditionContrast(
        first=first,
        second=second,
        gains=found.gains,
        losses=found.losses,
        **asdict(_mean(found)),
        by_source={name: _mean(difference) for name, difference in found.by_source.items()},
        by_groups={name: _group(interval) for name, interval in found.by_groups.items()},
    )


def _mean(difference: MeanDifference) -> Mean:
    lower, upper = ends(difference.interval)
    bootstrap = difference.bootstrap
    return Mean(
        value=number(bootstrap.estimate if bootstrap else None),
        lower=lower,
        upper=upper,
        bootstrap=bootstrap_of(bootstrap),
    )


def _group(interval: GroupInterval) -> study_document.GroupInterval:
    lower, upper = ends(interval.interval)
    return study_document.GroupInterval(
        groups=interval.groups,
        changed=interval.changed,
        replicates=interval.replicates,
        lower=lower,
        upper=upper,
    )


def _is_distance(value: object) -> bool:
    return type(value) in (int, float) and 0 <= value < float("inf")  # type: ignore[operator]
