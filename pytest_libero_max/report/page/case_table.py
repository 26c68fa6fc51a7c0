"""Data of the table of cases on the page of a run: every planned pair, played or not."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from urllib.parse import quote

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.diagnosis import CAUSES, NOT_RECORDED, diagnose
from pytest_libero_max.report.page.evidence import details_of, error_details, plan_details
from pytest_libero_max.runs.media import PICTURES_NAME, caption_of
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.substrates.registry import SUBSTRATES

OUTCOME_TITLES = {
    "preserved_success": "preserved",
    "change_associated_success": "change-associated",
    "regression": "regression",
    "persistent_failure": "persistent failure",
    "invalid": "invalid",
    "missing": "missing",
    "unsupported": "unsupported",
}
"""Titles of the outcomes; the last three are of pairs without a record."""

_FILMED = ("yes", "no")


def run_cases(
    stored: StoredRun,
    films: Mapping[str, Sequence[str]],
    pictures: Mapping[str, Sequence[str]],
    traced: bool = False,
) -> Json:
    """Return the data of the table of cases of a run.

    Args:
        stored: The run.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        pictures: Paths of the pictures of each pair that has some, in the same way.
        traced: True if traces lie beside the pairs, so that they can be filmed.

    Returns:
        ``items``: the item ids in their order; everything else is in the same order, or by the place in it.
        ``case_ids`` and ``instructions``: for the search. ``columns``: see :func:`label_columns` and
        :func:`number_column`. ``details``: the tables of each case. ``films`` and ``pictures``:
        captions and addresses. ``commands``: captions with the texts before and after the item id.
    """
    records = {record.item_id: record for record in stored.records}
    errors = {error.item_id: error for error in stored.errors}
    planned = sorted(stored.run.planned, key=lambda pair: pair.item_id)
    policy = stored.records[0].policy if stored.records else None
    unsupported = {pair.item_id for pair in unsupported_pairs(planned, policy)}
    found = [records.get(pair.item_id) for pair in planned]
    outcomes = [
        record.outcome if record else _without_record(pair.item_id, errors, unsupported)
        for pair, record in zip(planned, found, strict=True)
    ]
    filmed = [_FILMED[pair.item_id not in films] for pair in planned]
    columns = [
        *label_columns(planned),
        {**label_column("outcome", "Outcome", outcomes, [*OUTCOME_TITLES], OUTCOME_TITLES), "outcome": True},
        *_causes(found),
        number_column(
            "base_steps", "Base steps", [record and record.base_steps for record in found], secondary=True
        ),
        number_column(
            "dynamic_steps",
            "Dynamic steps",
            [record and record.dynamic_steps for record in found],
            secondary=True,
        ),
        number_column("stale", "Stale actions", [record and record.stale_actions for record in found]),
    ]
    if films:
        columns.append(label_column("film", "Film", filmed, _FILMED))
    return {
        "items": [pair.item_id for pair in planned],
        "columns": columns,
        "case_ids": [pair.case_id for pair in planned],
        "instructions": [record.instruction if record else "" for record in found],
        "details": [_details(pair, records, errors) for pair in planned],
        "films": media_by_place(planned, films),
        "pictures": media_by_place(planned, pictures),
        "commands": [*_commands(stored, traced)],
    }


def _causes(found: Sequence[PairRecord | None]) -> Iterator[Json]:
    """Return the column of causes, where one is known: that of Dynamic, or else that of Base."""
    whys = [
        record and (diagnose(record, DYNAMIC) or (BASE in record.arms and diagnose(record, BASE)) or None)
        for record in found
    ]
    causes = [why.cause if why else "none" for why in whys]
    if {*causes} - {"none", NOT_RECORDED}:
        yield label_column("cause", "Cause", causes, [*CAUSES, "none"])


def _commands(stored: StoredRun, traced: bool) -> Iterator[list[str]]:
    """Yield the commands on a case: caption, and the texts before and after its item id."""
    yield [
        "Play it again, in the folder in which the run was started:",
        shlex.join(replay_command(stored)),
        "",
    ]
    after = "in the folder of this page; libero-max report . then shows it here:"
    if traced:
        yield [f"Film it, {after}", "libero-max film .", ""]
    kind, _, track = stored.run.provenance["case_set"]["name"].partition(" ")
    substrate = stored.run.provenance["substrate"]["name"]
    if kind == "track" and substrate in SUBSTRATES and SUBSTRATES[substrate].plays_frozen:
        yield [
            f"Draw its event before and after, {after}",
            f"libero-max show {track}",
            f"--substrate={substrate} --pictures={PICTURES_NAME}",
        ]


def media_by_place(planned: Sequence[PlannedPair], paths: Mapping[str, Sequence[str]]) -> Json:
    """Captions and addresses of files by the place of their pair, as the page asks for them."""
    return {
        str(place): [[caption_of(path, pair.item_id), quote(path)] for path in paths[pair.item_id]]
        for place, pair in enumerate(planned)
        if pair.item_id in paths
    }


def label_columns(planned: Sequence[PlannedPair]) -> Iterator[Json]:
    """Yield the columns that a plan tells: those of the table, and three that can only be filtered by."""
    yield label_column("source", "Source", [pair.source for pair in planned], secondary=True)
    yield label_column("suite", "Suite", [pair.suite for pair in planned], secondary=True)
    yield label_column("category", "Source category", [pair.category for pair in planned], secondary=True)
    yield label_column("event", "Event", [pair.event for pair in planned], [*EVENTS], secondary=True)
    yield label_column("variant", "Variant", [str(pair.variant) for pair in planned], secondary=True)
    more = {
        "family": [pair.family for pair in planned],
        "severity": [pair.severity for pair in planned],
        "difficulty": ["none" if pair.difficulty is None else str(pair.difficulty) for pair in planned],
    }
    order = {"severity": ("low", "medium", "high")}
    for key, names in more.items():
        yield {**label_column(key, key.capitalize(), names, order.get(key, ())), "shown": False, "more": True}


def label_column(
    key: str,
    title: str,
    names: Sequence[str],
    order: Sequence[str] = (),
    titles: Mapping[str, str] | None = None,
    *,
    secondary: bool = False,
) -> Json:
    """Return a column of names, which can be chosen from.

    Args:
        key: Its name in the address of a view.
        title: Its heading.
        names: One a case.
        order: The first of the distinct names in their order; the others follow by the alphabet.
        titles: Titles of the names, where they differ from the names.
        secondary: True if narrow screens leave it out; the item id says it as well.
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
        "secondary": secondary,
    }
    return column if titles is None else {**column, "titles": [titles[label] for label in labels]}


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


def _details(pair: PlannedPair, records: Mapping[str, PairRecord], errors: Mapping[str, PairError]) -> Json:
    if pair.item_id in records:
        return details_of(pair, records[pair.item_id])
    return error_details(pair, errors[pair.item_id]) if pair.item_id in errors else plan_details(pair)
