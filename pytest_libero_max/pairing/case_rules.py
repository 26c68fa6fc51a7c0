"""Rules on a pair record and its case: the manifest says what is played, and no record says otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.structs import shown
from pytest_libero_max.errors import LiberoMaxError, ReportError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.record import PairRecord


def require_of_case(record: PairRecord, case: Case) -> None:
    """Check that a record is of its case: its labels, its instruction, and the schedules of its arms.

    Arms that a study adds are not the case's, and are not looked at.

    Raises:
        ReportError: It contradicts the case; names the field.
    """
    strength = record.fingerprints.get("strength", "1")
    try:
        compared = [*_compared(record, case, float(strength))]
    except (ValueError, LiberoMaxError) as error:
        raise ReportError(
            f"{record.item_id!r}: fingerprints.strength={shown(strength)}, at which its case cannot be "
            f"played: {error}"
        ) from error
    for name, value, wanted in compared:
        if value != wanted:
            name, value, wanted = _innermost(name, value, wanted)
            raise ReportError(
                f"{record.item_id!r}: {name}={shown(value)}, but by its case it is {shown(wanted)}. Such a "
                "pair was not played. Play it again."
            )


def _innermost(name: str, value: Any, wanted: Any) -> tuple[str, Any, Any]:
    """Return the first field within a field in which two values differ, where they are of one form."""
    if type(value) is dict and type(wanted) is dict and value.keys() == wanted.keys():
        key = next(key for key in value if value[key] != wanted[key])
        return _innermost(f"{name}.{key}", value[key], wanted[key])
    if type(value) is list and type(wanted) is list and len(value) == len(wanted):
        index = next(index for index in range(len(value)) if value[index] != wanted[index])
        return _innermost(f"{name}[{index}]", value[index], wanted[index])
    return name, value, wanted


def _compared(record: PairRecord, case: Case, strength: float) -> Iterator[tuple[str, Any, Any]]:
    """Yield fields with their values in the record and by the case."""
    yield "task_index", record.task_index, case.task_index
    yield "init_state_index", record.init_state_index, case.init_state_index
    yield "policy_seed", record.policy_seed, case.policy_seed
    yield "trigger_entity", record.trigger_entity, case.event.entity
    if case.instruction is not None and not case.event.setup:  # which may give another one
        yield "instruction", record.instruction, case.instruction
    own = {arm.name for arm in arms_of(case, strength=strength)}
    for arm in arms_of(case, repeat_base=True, strength=strength, sham=True):
        played = record.arms.get(arm.name)
        if played is None:
            if arm.name in own:
                yield f"arms.{arm.name}", None, arm.to_dict()
            continue
        yield f"arms.{arm.name}.repetition", played.repetition, arm.repetition
        schedule = [entry.to_dict() for entry in arm.schedule]
        yield f"arms.{arm.name}.schedule", [*played.schedule], schedule
