"""The events of a run as a page shows them: pictures and parameters."""

from __future__ import annotations

import base64
import inspect
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.page.evidence import flat
from pytest_libero_max.runs.plan import PlannedPair

PICTURES = "pictures"
"""Folder of the pictures beside this file, one a variant of an event."""

PICTURE_SIZE = (512, 128)
"""Width and height of a picture, which is four side by side."""

NOTE = (
    "The pictures are of other cases, on embedded scenes: the agent's view before and after the event, and "
    "the wrist camera's before and after."
)

_VARIES = object()


def events_section(planned: Iterable[PlannedPair], records: Iterable[PairRecord] = ()) -> list[str]:
    """Return the events with pictures and parameters as markup, in the benchmark's order.

    Args:
        planned: Pairs whose events are shown.
        records: Pairs whose parameters are said.
    """
    pairs = {pair.event_variant: pair for pair in planned}
    found: dict[str, list[PairRecord]] = {name: [] for name in pairs}
    for record in records:
        found[f"{record.event}-v{record.variant}"].append(record)
    names = sorted(pairs, key=lambda name: group_order("variant", name))
    cards = [_card(pairs[name], found[name]) for name in names]
    if not cards:
        return []
    return [
        "<h2 id='events'>Events</h2>",
        f"<p>{escape(NOTE)} A parameter that differs between the cases of a variant is with each case.</p>",
        f"<div class='events'>{''.join(cards)}</div>",
    ]


def _card(pair: PlannedPair, records: Sequence[PairRecord]) -> str:
    name = pair.event_variant
    facts = {"Severity": pair.severity, "Family": pair.family, **_common_parameters(records)}
    listed = "".join(
        f"<dt>{escape(key)}</dt><dd>{escape(_spelled(value))}</dd>" for key, value in facts.items()
    )
    view = f"event={pair.event}&amp;variant={pair.variant}"
    return (
        f"<article class='event' id='event-{escape(name, quote=True)}'>"
        f"<h3 data-view='{view}'>{escape(pair.event)}, variant {pair.variant}</h3>"
        f"{_picture(name)}<p>{escape(_sentence(pair.event))}</p>"
        f"<details><summary>Parameters</summary><dl>{listed}</dl></details></article>"
    )


def _picture(name: str) -> str:
    file = resources.files("pytest_libero_max.report.page").joinpath(PICTURES, f"{name}.webp")
    if not file.is_file():
        return ""  # an event of another package
    width, height = PICTURE_SIZE
    content = base64.b64encode(file.read_bytes()).decode()
    return (
        f"<img src='data:image/webp;base64,{content}' width='{width}' height='{height}' "
        f"alt='{escape(name, quote=True)}: agent view before and after, wrist camera before and after'>"
    )


def _sentence(event: str) -> str:
    """Return the first paragraph of an event's kind; empty where the kind is not installed."""
    text = inspect.cleandoc(type(EVENTS[event]).__doc__ or "") if event in EVENTS else ""
    return " ".join(text.partition("\n\n")[0].split()).replace("``", "")


def _common_parameters(records: Sequence[PairRecord]) -> Json:
    """Return trigger and change of all cases; parameters that differ between them are marked."""
    asked = [
        [
            named
            for entry in record.arm(DYNAMIC).schedule or ()
            for part in ("trigger", "change")
            for named in flat(entry.get(part) or {}, part)
        ]
        for record in records
    ]
    common: dict[str, Any] = {}
    for place, pairs in enumerate(asked):
        for key, value in pairs:
            if not place:
                common[key] = value
            elif common.get(key, _VARIES) != value:
                common[key] = _VARIES
    return common


def _spelled(value: Any) -> str:
    if value is _VARIES:
        return "differs between cases"
    return value if isinstance(value, str) else json.dumps(value)
