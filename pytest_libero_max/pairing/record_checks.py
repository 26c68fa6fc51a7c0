"""What a stored record says is checked when it is read: each field by itself, and what must agree."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.fields import (
    ANY_TEXT,
    ARMS,
    COUNT,
    COUNTS,
    DISTANCE,
    FLAG,
    LARGEST,
    NAMED_TEXTS,
    OBJECT,
    POLICY,
    PROOF,
    SCHEDULE,
    SHA256,
    TEXT,
    TEXTS,
    listed,
    one_of,
)

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import ArmRecord, PairRecord

IDENTITY = {
    "case_id": TEXT,
    "item_id": TEXT,
    "case_digest": SHA256,
    "source": one_of("libero", "plus", "pro"),
    "source_category": TEXT,
    "difficulty": one_of(None, 1, 2, 3, 4, 5),
    "suite": TEXT,
    "event": TEXT,
    "family": TEXT,
    "variant": one_of(0, 1),
    "severity": TEXT,
}
"""Rules of the fields that a record has in common with the pair as it was planned."""

PAIR_FIELDS = {
    **IDENTITY,
    "task_index": COUNT,
    "init_state_index": COUNT,
    "policy_seed": COUNT,
    "instruction": TEXT,
    "trigger_entity": TEXT,
    "max_steps": COUNT,
    "arms": ARMS,
    "policy": POLICY,
    "fingerprints": NAMED_TEXTS,
    "timings": OBJECT,
    "schema_version": COUNT,
}
ARM_FIELDS = {
    "schedule": SCHEDULE.or_null,
    "repetition": COUNT,
    "success": FLAG,
    "steps": COUNT.or_null,
    "queries": COUNT.or_null,
    "firings": listed("objects", OBJECT.holds),
    "response_step": COUNT.or_null,
    "stale_actions": COUNT.or_null,
    "min_distance_m": DISTANCE.or_null,
    "clipped_components": COUNT.or_null,
    "contacts": TEXTS.or_null,
    "proof": PROOF.or_null,
    "shares": TEXT.or_null,
    "notes": COUNTS.or_null,
    "probes": OBJECT,
}
FIRING_FIELDS = {
    "step": COUNT,
    "queries": COUNT,
    "distance_m": DISTANCE,
    "prefix_proof": PROOF,
    "evidence": OBJECT,
}
ERROR_FIELDS = {
    "case_id": TEXT,
    "item_id": TEXT,
    "case_digest": SHA256,
    "kind": TEXT,
    "message": ANY_TEXT,
    "phase": TEXT,
    "schema_version": COUNT,
}


def require_consistent_arm(arm: ArmRecord) -> None:
    """Check that what an arm says of its event agrees.

    Raises:
        ReportError: It does not.
    """
    if arm.schedule is not None and len(arm.firings) > len(arm.schedule):
        raise ReportError(
            f"{len(arm.firings)} firings of an arm whose schedule has {len(arm.schedule)} entries."
        )
    if not arm.firings:
        if arm.response_step is not None or arm.stale_actions is not None:
            raise ReportError(
                f"response_step={arm.response_step} and stale_actions={arm.stale_actions} of an arm in which "
                "nothing happened, but must be null."
            )
        return
    steps = LARGEST if arm.steps is None else arm.steps
    moments = [firing.step for firing in arm.firings]
    if moments != sorted(moments) or moments[-1] > steps:
        raise ReportError(f"Firings at the steps {moments} of an arm of {steps} steps, in this order.")
    event = moments[0]
    if arm.response_step is not None and not event <= arm.response_step <= steps:
        raise ReportError(
            f"response_step={arm.response_step}, but the event was at step {event} and the arm took {steps} "
            "steps: a response comes after the event."
        )
    stale = (steps if arm.response_step is None else arm.response_step) - event
    if arm.stale_actions != stale:
        raise ReportError(
            f"stale_actions={arm.stale_actions}, but {stale} actions were executed between the event (step "
            f"{event}) and the next query (response_step={arm.response_step}, steps={steps})."
        )


def require_consistent_pair(record: PairRecord) -> None:
    """Check that what the arms of a record say agrees.

    Raises:
        ReportError: It does not.
    """
    for name, arm in record.arms.items():
        if arm.steps is not None and arm.steps > record.max_steps:
            raise ReportError(f"steps={arm.steps} of arm {name!r}, but max_steps={record.max_steps}.")
        if arm.shares is not None:
            _require_shared(record, name, arm)
    if BASE not in record.arms or DYNAMIC not in record.arms:
        return
    base, dynamic = record.arms[BASE], record.arms[DYNAMIC]
    for name, arm in ((BASE, base), (DYNAMIC, dynamic)):
        for held in ("steps", "queries", "contacts", "proof"):
            if getattr(arm, held) is None:
                raise ReportError(f"{held}=None of arm {name!r}, which every record holds.")
    if base.min_distance_m is None:
        raise ReportError(f"min_distance_m=None of arm {BASE!r}, which every record holds.")
    if base.schedule or base.firings:
        raise ReportError(f"arm {BASE!r} has an event, but nothing happens in Base.")
    event = record.trigger
    if event is None:
        if (base.success, base.proof) != (dynamic.success, dynamic.proof):
            raise ReportError("the event never came, but Base and Dynamic differ.")
    elif event.step > record.base_steps or event.queries > (dynamic.queries or 0):
        raise ReportError(
            f"the event came after {event.step} steps and {event.queries} queries, but Base took "
            f"{record.base_steps} steps and Dynamic {dynamic.queries} queries."
        )


def _require_shared(record: PairRecord, name: str, arm: ArmRecord) -> None:
    """Check that an arm that was not played is the earlier arm that it names."""
    names = list(record.arms)
    earlier = names[: names.index(name)]
    if arm.shares not in earlier:
        raise ReportError(f"shares={arm.shares!r} of arm {name!r}, but the arms before it are {earlier}.")
    if arm != replace(record.arms[arm.shares], schedule=arm.schedule, shares=arm.shares):
        raise ReportError(f"arm {name!r} differs from {arm.shares!r}, which it says it shares.")
