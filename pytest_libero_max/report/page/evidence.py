"""Details of one case: tables by their titles, names with values or with values by column."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.schedules import DYNAMIC
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.diagnosis import NOT_RECORDED, diagnose
from pytest_libero_max.report.happenings import happenings, happenings_text
from pytest_libero_max.runs.plan import PlannedPair

_DIGITS = 16
"""Hexadecimal digits of a digest that are shown; the records have all of them."""


def details_of(pair: PlannedPair, record: PairRecord) -> Json:
    """Return what is shown of a measured pair.

    Returns:
        ``says``: arm, cause and sentence of each arm that failed. ``tables``: arms and event by their titles.
        ``more``: tables of the case, of parameters, and of values before and after the event.
    """
    case = _case(pair) | {
        "Instruction": record.instruction,
        "Initial state": record.init_state_index,
        "Policy seed": record.policy_seed,
        "Steps at most": record.max_steps,
        "Trigger entity": record.trigger_entity,
    }
    tables = dict(_event(record))
    return {
        "says": _happened(record),
        "tables": {"Arms": _arms(record), "Event": tables.pop("Event")},
        "more": {"Case": case, **tables},
    }


def _happened(record: PairRecord) -> list[tuple[str, str, str]]:
    found = {name: diagnose(record, name) for name in record.arms}
    return [
        (name, why.cause, why.sentence)
        for name, why in found.items()
        if why is not None and why.cause != NOT_RECORDED
    ]


def error_details(pair: PlannedPair, error: PairError) -> Json:
    """Return the tables of a pair that could not be measured."""
    row = {"Phase": error.phase, "Kind": error.kind, "Message": error.message}
    return {"tables": {"Error": row}, "more": {"Case": _case(pair)}}


def plan_details(pair: PlannedPair) -> Json:
    """Return the table of a pair of which only the plan is known."""
    return {"tables": {}, "more": {"Case": _case(pair)}}


def flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values inside nested objects, by their names joined with dots; an empty object is a value."""
    if not isinstance(value, Mapping) or not value:
        yield name, value if value != {} else None
        return
    for key, part in value.items():
        yield from flat(part, f"{name}.{key}" if name else str(key))


def _case(pair: PlannedPair) -> Json:
    return {"Task": pair.task}


def _arms(record: PairRecord) -> Json:
    """Return a row a quantity, a column an arm."""
    own = {
        name: (record.policy if arm.policy is None else arm.policy)["name"]
        for name, arm in record.arms.items()
    }
    policies = {"Policy": own} if any(arm.policy is not None for arm in record.arms.values()) else {}
    return policies | {
        title: {name: getattr(arm, field) for name, arm in record.arms.items()}
        for title, field in (
            ("Success", "success"),
            ("Steps", "steps"),
            ("Queries", "queries"),
            ("Smallest distance to the trigger entity, m", "min_distance_m"),
            ("Touches the trigger entity at the end", "contacts"),
            ("Action components that were clipped", "clipped_components"),
        )
    }


def _event(record: PairRecord) -> Iterator[tuple[str, Json]]:
    arm = record.arm(DYNAMIC)
    schedule = arm.schedule
    trigger = record.trigger
    found = happenings(record, arm)
    happened: Json = {"Happened": trigger is not None}
    if found and not found[0].is_event:
        happened["Changes of the program"] = happenings_text(found)
    if trigger is not None:
        happened |= {
            "After steps": trigger.step,
            "Distance to the trigger entity, m": trigger.distance_m,
            "Next query after steps": record.response_step,
            "Stale actions": record.stale_actions,
            "Digest of the prefix that the arms share": trigger.prefix_proof[:_DIGITS],
        }
    yield "Event", happened
    for number, entry in enumerate(schedule, start=1):
        which = f", {number} of {len(schedule)}" if len(schedule) > 1 else ""
        asked = {**_named("trigger", entry.get("trigger")), **_named("", entry.get("change"))}
        if asked:
            yield f"Parameters{which}", asked
    if found:
        first = found[0]
        changed = "What the event changed" if first.is_event else f"What changed first: {first.name}"
        yield from _evidence(first.firing.evidence, changed)


def _evidence(evidence: Json, title: str) -> Iterator[tuple[str, Json]]:
    before, after = (dict(flat(evidence.get(end) or {})) for end in ("before", "after"))
    names = [name for name in {**before, **after} if name and before.get(name) != after.get(name)]
    if names:
        yield (title, {name: {"before": before.get(name), "after": after.get(name)} for name in names})
    rest = {key: value for key, value in evidence.items() if key not in ("before", "after", "operation")}
    if rest:
        yield "Evidence", dict(flat(rest))


def _named(name: str, value: Any) -> Json:
    return dict(flat(value, name)) if value else {}
