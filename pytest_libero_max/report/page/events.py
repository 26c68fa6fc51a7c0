"""Events of a run as a page shows them: pictures and parameters."""

from __future__ import annotations

import base64
import inspect
import json
from collections.abc import Iterable, Sequence
from importlib import resources
from typing import Any, NamedTuple
from urllib.parse import urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.page.case_table import flat
from pytest_libero_max.runs.plan import PlannedPair

_VARIES = object()


class ShownEvent(NamedTuple):
    """A variant of an event as a page shows it."""

    name: str
    title: str
    view: str
    """View of the table of cases that has its cases alone."""
    picture: str
    """Base64 of a WebP of 512x128 pixels; empty for an event of another package."""
    sentence: str
    """Description of the event; empty where its kind is not installed."""
    facts: list[tuple[str, str]]
    """Names and values: severity, family and the parameters that all its cases share."""


def events_of(planned: Iterable[PlannedPair], records: Iterable[PairRecord] = ()) -> list[ShownEvent]:
    """Return the events with pictures and parameters, in the benchmark's order."""
    pairs = {pair.event_variant: pair for pair in planned}
    found: dict[str, list[PairRecord]] = {name: [] for name in pairs}
    for record in records:
        found[f"{record.event}-v{record.variant}"].append(record)
    names = sorted(pairs, key=lambda name: group_order("variant", name))
    return [_shown(name, pairs[name], found[name]) for name in names]


def _shown(name: str, pair: PlannedPair, records: Sequence[PairRecord]) -> ShownEvent:
    facts = {"Severity": pair.severity, "Family": pair.family, **_common_parameters(records)}
    return ShownEvent(
        name=name,
        title=f"{pair.event}, variant {pair.variant}",
        view=urlencode({"event": pair.event, "variant": pair.variant}),
        picture=_picture(name),
        sentence=_sentence(pair.event),
        facts=[(key, _spelled(value)) for key, value in facts.items()],
    )


def _picture(name: str) -> str:
    if name.rpartition("-v")[0] not in EVENTS:
        return ""
    file = resources.files(__package__).joinpath("pictures", f"{name}.webp")
    return base64.b64encode(file.read_bytes()).decode() if file.is_file() else ""


def _sentence(event: str) -> str:
    """Return the first paragraph of an event's kind; empty where the kind is not installed."""
    text = inspect.cleandoc(type(EVENTS[event]).__doc__ or "") if event in EVENTS else ""
    return " ".join(text.partition("\n\n")[0].split()).replace("``", "")


def _common_parameters(records: Sequence[PairRecord]) -> Json:
    """Return trigger and change of all cases; parameters that differ between them are marked."""
    asked = [
        [
            named
            for entry in record.arm(DYNAMIC).schedule
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
