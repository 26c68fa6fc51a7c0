"""Data of the table of cases on the page of a run: every planned pair, played or not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.pairing.record_rules import CONTROL_HZ
from pytest_libero_max.pairing.trace import read_trace, trace_name
from pytest_libero_max.report.diagnosis import CAUSES, NOT_RECORDED, diagnose
from pytest_libero_max.report.happenings import happenings, happenings_text
from pytest_libero_max.report.palette import arm_kinds
from pytest_libero_max.report.plots import OUTCOME_TITLES
from pytest_libero_max.runs.media import PICTURES_NAME, TRACES_NAME, caption_of
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.replay_command import film_text, replay_command, replay_text
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.substrates.registry import SUBSTRATES

_FILMED = {"yes": "film", "no": ""}
_FIRED = {"yes": "", "never": "never", "not played": ""}
_NO_CAUSE = "none"
"""Labels of a case with their texts in the table, which says nothing of what needs no look."""

ORDER = (
    "regression", "change_associated_success", "invalid", "persistent_failure", "preserved_success",
    "missing", "unsupported",
)  # fmt: skip
"""Outcomes in the order of the table: those to look at first."""


def run_cases(
    stored: StoredRun,
    films: Mapping[str, Sequence[str]],
    pictures: Mapping[str, Sequence[str]],
    folder: Path | None = None,
) -> Json:
    """Return the data of the table of cases of a run.

    Returns:
        ``items``: the item ids, those of regressions first; everything else is in the same order, or by the
        place in it.
        ``case_ids`` and ``instructions``: for the search. ``columns``: see :func:`label_columns` and
        :func:`number_column`. ``details``: of each case, see :func:`_details`. ``films`` and
        ``pictures``: captions and addresses. ``has``: what there is of a case. ``commands``: see
        :func:`command`. ``hz``: policy steps in a second of a film.
    """
    records = {record.item_id: record for record in stored.records}
    errors = {error.item_id: error for error in stored.errors}
    policy = stored.records[0].policy if stored.records else None
    unsupported = {pair.item_id for pair in unsupported_pairs(stored.run.planned, policy)}
    by_item = {
        pair.item_id: records[pair.item_id].outcome
        if pair.item_id in records
        else _without_record(pair.item_id, errors, unsupported)
        for pair in stored.run.planned
    }
    planned = sorted(stored.run.planned, key=lambda pair: (ORDER.index(by_item[pair.item_id]), pair.item_id))
    found = [records.get(pair.item_id) for pair in planned]
    outcomes = [by_item[pair.item_id] for pair in planned]
    steps = {
        f"{arm}_steps": [record and getattr(record, f"{arm}_steps") for record in found]
        for arm in (BASE, DYNAMIC)
    }
    outcome = label_column("outcome", "Outcome", outcomes, ORDER, OUTCOME_TITLES)
    columns = [
        *label_columns(planned),
        {**outcome, "outcome": True, "chips": True},
        *_causes(found),
        *_fired(found),
        number_column("base_steps", "Base steps", steps["base_steps"], secondary=True),
        number_column("dynamic_steps", "Dynamic steps", steps["dynamic_steps"], secondary=True),
        number_column("stale", "Stale actions", [record and record.stale_actions for record in found]),
    ]
    if films:
        filmed = ["yes" if pair.item_id in films else "no" for pair in planned]
        columns.append(label_column("film", "Film", filmed, [*_FILMED], cells=_FILMED))
    traces = set() if folder is None else {path.name for path in (folder / TRACES_NAME).glob("*.npz")}
    has = {
        str(place): [
            *(["record"] if record else []),
            *(["trace"] if trace_name(pair.item_id) in traces else []),
            *_views(films.get(pair.item_id, ())),
            *(["pictures"] if pair.item_id in pictures else []),
        ]
        for place, (pair, record) in enumerate(zip(planned, found, strict=True))
    }
    details = [_details(pair, records.get(pair.item_id), errors.get(pair.item_id)) for pair in planned]
    for pair, record, detail in zip(planned, found, details, strict=True):
        if record is not None and pair.item_id in films:
            detail["timeline"] = timeline_of(record, folder)
    return {
        "items": [pair.item_id for pair in planned],
        "columns": columns,
        "case_ids": [pair.case_id for pair in planned],
        "instructions": [record.instruction if record else "" for record in found],
        "details": details,
        "films": media_by_place(planned, films),
        "pictures": media_by_place(planned, pictures),
        "has": has,
        "commands": [*_commands(stored)],
        "hz": next((record.control_hz for record in stored.records), CONTROL_HZ),
    }


def _views(films: Sequence[str]) -> set[str]:
    """Return the views of films: ``film`` of the world, ``policy view`` of what the policy saw."""
    return {"policy view" if film.rpartition(".")[0].endswith("--policy") else "film" for film in films}


def _fired(found: Sequence[PairRecord | None]) -> Iterator[Json]:
    if any(record is not None and not record.triggered for record in found):
        fired = [
            "not played" if record is None else "yes" if record.triggered else "never" for record in found
        ]
        yield {**label_column("fired", "Event happened", fired, [*_FIRED], cells=_FIRED), "chips": True}


def _causes(found: Sequence[PairRecord | None]) -> Iterator[Json]:
    lost = [
        diagnose(record, DYNAMIC) if record and record.outcome == "regression" else None for record in found
    ]
    base = [diagnose(record, BASE) if record and BASE in record.arms else None for record in found]
    for key, title, whys in (("cause", "Cause", lost), ("base_cause", "Cause in Base", base)):
        causes = [why.cause if why else _NO_CAUSE for why in whys]
        if {*causes} - {_NO_CAUSE, NOT_RECORDED}:
            titles = {cause: cause.replace("_", " ") for cause in causes}
            column = label_column(
                key, title, causes, [*CAUSES, _NO_CAUSE], titles, cells={**titles, _NO_CAUSE: ""}
            )
            yield {**column, "chips": True}


def _commands(stored: StoredRun) -> Iterator[Json]:
    replay, there = replay_command(stored), ", in the folder in which the run was started:"
    yield again("Play it", replay, there, unless=["record"])
    yield again("Play it again", replay, there, needs=["record"])
    if replay:
        yield command(
            f"Play it again and film it{there}", film_text(replay), needs=["record"], unless=["film", "trace"]
        )
    after = "in the folder of this page; libero-max report . then shows it here:"
    yield command(f"Film it, {after}", "libero-max film .", needs=["trace"], unless=["film"])
    yield command(
        f"Film what the policy saw, {after}",
        "libero-max film .",
        "--view=policy",
        needs=["trace", "film"],
        unless=["policy view"],
    )
    yield command(
        "Write every pose of it for Rerun, in the folder of this page:",
        "libero-max lab rerun .",
        needs=["trace"],
    )
    kind, _, track = stored.run.provenance["case_set"]["name"].partition(" ")
    substrate = stored.run.provenance["substrate"]["name"]
    if kind == "track" and substrate in SUBSTRATES and SUBSTRATES[substrate].plays_frozen:
        yield command(
            f"Draw its event before and after, {after}",
            f"libero-max list cases {track}",
            f"--substrate={substrate} --pictures={PICTURES_NAME}",
            unless=["film", "pictures"],
        )


def again(
    caption: str, replay: Sequence[str], there: str, needs: Sequence[str] = (), unless: Sequence[str] = ()
) -> Json:
    """Return the command that plays a case again, or a sentence where no command can."""
    if not replay:
        return command(f"{caption} {replay_text(replay)}", "", "", needs, unless)
    return command(f"{caption}{there}", replay_text(replay), "", needs, unless)


def command(
    caption: str, before: str, after: str = "", needs: Sequence[str] = (), unless: Sequence[str] = ()
) -> Json:
    """Return a command on a case.

    Args:
        before: Text before the item id; empty where the caption says all.
        needs: It is offered where the case has all of these ...
        unless: ... and none of these, in the words of ``has``.
    """
    return {"caption": caption, "before": before, "after": after, "needs": needs, "unless": unless}


def media_by_place(planned: Sequence[PlannedPair], paths: Mapping[str, Sequence[str]]) -> Json:
    """Captions and addresses of files by the place of their pair, as the page asks for them."""
    return {
        str(place): [[caption_of(path, pair.item_id), quote(path)] for path in paths[pair.item_id]]
        for place, pair in enumerate(planned)
        if pair.item_id in paths
    }


def label_columns(planned: Sequence[PlannedPair]) -> Iterator[Json]:
    """Yield the columns that a plan tells. Item ids say them, so that they only filter and order."""
    events, categories = [pair.event for pair in planned], [pair.category for pair in planned]
    yield {**label_column("event", "Event", events, [*EVENTS]), "shown": False}
    yield {**label_column("category", "Source category", categories), "shown": False}
    for key, names, more in (
        ("suite", [pair.suite for pair in planned], False),
        ("source", [pair.source for pair in planned], True),
        ("variant", [str(pair.variant) for pair in planned], True),
        ("family", [pair.family for pair in planned], True),
        ("severity", [pair.severity for pair in planned], True),
        (
            "difficulty",
            ["none" if pair.difficulty is None else str(pair.difficulty) for pair in planned],
            True,
        ),
    ):
        order = ("low", "medium", "high") if key == "severity" else ()
        yield {**label_column(key, key.capitalize(), names, order), "shown": False, "more": more}


def label_column(
    key: str,
    title: str,
    names: Sequence[str],
    order: Sequence[str] = (),
    titles: Mapping[str, str] | None = None,
    *,
    cells: Mapping[str, str] | None = None,
) -> Json:
    """Return a column of names, which can be chosen from.

    Args:
        order: The first of the distinct names in their order; the others follow by the alphabet.
        titles: Titles of the names, where they differ from the names.
        cells: Texts of the names in the table, where they differ from the titles.
    """
    there = set(names)
    labels = [name for name in order if name in there]
    labels += sorted(there - set(labels))
    places = {label: place for place, label in enumerate(labels)}
    column = {
        "key": key,
        "title": title,
        "labels": labels,
        "at": [places[name] for name in names],
        "shown": True,
        "filter": "choice",
    }
    texts = {"titles": titles, "cells": cells}
    return column | {
        name: [known[label] for label in labels] for name, known in texts.items() if known is not None
    }


def number_column(key: str, title: str, values: Sequence[Any], **more: bool) -> Json:
    """Return a column of numbers, which can be bounded; None where a case has none."""
    values = list(values)
    return {
        "key": key,
        "title": title,
        "values": values,
        "shown": True,
        "filter": "range",
        "more": True,
        **more,
    }


def _without_record(item: str, errors: Mapping[str, PairError], unsupported: set[str]) -> str:
    return "invalid" if item in errors else "unsupported" if item in unsupported else "missing"


_DIGITS = 16
"""Hexadecimal digits of a digest that are shown; the records have all of them."""


def _details(pair: PlannedPair, record: PairRecord | None, error: PairError | None) -> Json:
    """Return what is shown of a pair.

    Returns:
        ``tables``: arms and event by their titles, or the error. ``more``: tables of the case, of parameters,
        and of values before and after the event. ``says``, of a measured pair: arm, cause and sentence of
        each arm that failed.
    """
    case: Json = {"Task": pair.task}
    if record is None:
        row = error and {"Phase": error.phase, "Kind": error.kind, "Message": error.message}
        return {"tables": {"Error": row} if row else {}, "more": {"Case": case}}
    case |= {
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


def flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values inside nested objects, by their names joined with dots; an empty object is a value."""
    if not isinstance(value, Mapping) or not value:
        yield name, value if value != {} else None
        return
    for key, part in value.items():
        yield from flat(part, f"{name}.{key}" if name else str(key))


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


_MOST_POINTS = 200
"""Number of points of a curve, of which a page draws few more than it has pixels."""


def timeline_of(record: PairRecord, folder: Path | None = None) -> Json:
    """Return the moments of a pair, in policy steps.

    Returns:
        ``steps``: of the longest arm. ``arms``: by name, ``end`` (steps), ``success``, ``events`` (steps),
        ``stale`` (number of stale actions after the first event) and ``kind`` (class of its colour); where
        the trace is kept, ``curve``:
        distance of the hand to the trigger entity in mm, one value ``every`` so many steps.
    """
    arms: Json = {}
    curves = {} if folder is None else _curves(record, folder)
    for name, arm in record.arms.items():
        if arm.shares is None:
            arms[name] = {
                "end": arm.steps,
                "success": arm.success,
                "events": [firing.step for firing in arm.firings],
                "stale": arm.stale_actions or 0,
                **curves.get(name, {}),
            }
    kinds = arm_kinds(arms)
    for name, arm_moments in arms.items():
        arm_moments["kind"] = kinds[name]
    return {"steps": max((arm["end"] for arm in arms.values()), default=0), "arms": arms}


def _curves(record: PairRecord, folder: Path) -> Json:
    """Return the curves of the arms; none where the trace is missing or cannot be read."""
    path = folder / TRACES_NAME / trace_name(record.item_id)
    if not path.is_file():
        return {}
    try:
        traces = read_trace(require_inside(folder, path), record)
    except ReportError:
        return {}
    curves = {}
    for name, trace in traces.items():
        if not trace.actions.size:
            continue
        every = 1 + len(trace.actions) // _MOST_POINTS
        distances = np.linalg.norm(trace.end_effector - trace.entity, axis=1)
        curves[name] = {"every": every, "curve": np.rint(1000 * distances[::every]).astype(int).tolist()}
    return curves
