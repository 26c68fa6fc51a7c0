"""Causes of failed arms: one for each, from a fixed vocabulary, by rules over the stages that were recorded.

A diagnosis is a pure function of a pair's record. It says what happened, in the first of :data:`CAUSES` that
fits; it does not say why the policy acted so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.arm_stages import STAGES, FailedArm, has_stages
from pytest_libero_max.report.cause_rules import RULES
from pytest_libero_max.report.report_document import ChangedPair

__all__ = ["CAUSES", "NOT_RECORDED", "STAGES", "Diagnosis", "changed_pairs", "diagnose"]

NOT_RECORDED = "not_recorded"


@dataclass(frozen=True)
class Diagnosis:
    """The cause of a failed arm."""

    cause: str
    sentence: str


def diagnose(record: PairRecord, arm: str) -> Diagnosis | None:
    """Return the diagnosis of an arm of a pair; None if it succeeded.

    Raises:
        ReportError: The case was not played in this arm.
    """
    played = record.arm(arm)
    if played.success:
        return None
    base = record.arms.get(BASE)
    if base is not None and arm != BASE and not base.success:
        found = _of_arm(record, base)
        return Diagnosis("already_failing_in_base", f"Base failed too ({found.cause}). {found.sentence}")
    return _of_arm(record, played)


def changed_pairs(records: Iterable[PairRecord]) -> list[ChangedPair]:
    """Return the pairs of which one arm succeeded and the other failed, in the order of their item ids."""
    found = []
    for record in sorted(records, key=lambda record: record.item_id):
        if record.base_success != record.dynamic_success:
            why = diagnose(record, DYNAMIC if record.base_success else BASE)
            assert why is not None
            found.append(
                ChangedPair(
                    item_id=record.item_id,
                    event=record.event,
                    outcome="regression" if record.base_success else "change_associated_success",
                    cause=why.cause,
                    sentence=why.sentence,
                )
            )
    return found


def _of_arm(record: PairRecord, played: ArmRecord) -> Diagnosis:
    if not has_stages(played):
        return Diagnosis(NOT_RECORDED, "The record holds no stages.")
    arm = FailedArm.of(record, played)
    return next(Diagnosis(cause, sentence) for cause, rule in RULES if (sentence := rule(arm)))


CAUSES: Mapping[str, str] = {
    NOT_RECORDED: "The record holds no stages: it was written before there were any.",
    "already_failing_in_base": "Base failed as well.",
    **{cause: " ".join((rule.__doc__ or "").split()) for cause, rule in RULES},
}
"""Every cause with its meaning. That of an arm is the first that fits, in this order."""
