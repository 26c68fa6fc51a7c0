"""Pairs that broke or were gained as cards of a page: a card a cause and event, with a film where one is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from urllib.parse import quote, urlencode

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import Group, Part, parts_of
from pytest_libero_max.report.happenings import arm_title
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.runs.media import filmed_arms

_MOST_CARDS = 8

_AFTER_EVENT_S = 0.1
"""Time in a film at which it shows the event, also with half of its frames."""


class Card(NamedTuple):
    """Pairs of one cause under one event."""

    number: int
    cause: str
    what: str
    """The event, with the programs that were played in its place."""
    view: str
    """View of the table of cases that has them alone."""
    sentence: str
    """What happened in the pair that is shown; empty where that was not recorded."""
    case: str
    """View of the table that shows this pair."""
    film: str
    """Address of its film, from just after the event; empty without one."""
    arms: Sequence[str]
    """Titles of the arms of the film from left to right, with the policy of those that have their own."""


class Cards(NamedTuple):
    """The pairs of an outcome."""

    part: Part
    cards: Sequence[Card]
    more: int
    view: str


def broken_cards(
    report: Report, films: Mapping[str, Sequence[str]], records: Mapping[str, PairRecord]
) -> list[Cards]:
    """Return cards of what Base fails at where it solves little, and of what was lost and gained."""
    parts = parts_of(report, films, most=10**6, most_groups=_MOST_CARDS)
    return [
        Cards(
            part,
            [_card(part.outcome, group, films, records) for group in part.groups if group.named],
            sum(group.number for group in part.groups if not group.named),
            urlencode({"outcome": part.outcome}),
        )
        for part in parts
    ]


def _card(
    outcome: str, group: Group, films: Mapping[str, Sequence[str]], records: Mapping[str, PairRecord]
) -> Card:
    pair = next((pair for pair in group.named if pair.item_id in films), group.named[0])
    record, film, arms = records.get(pair.item_id), "", []
    if pair.item_id in films:
        path = films[pair.item_id][0]
        film = quote(path)
        if record is not None:
            arms = [arm_title(name, record.arms.get(name)) for name in filmed_arms(path, record)]
            if group.event and record.trigger is not None:  # a failure in Base has no event
                film += f"#t={record.trigger.step / record.control_hz + _AFTER_EVENT_S:g}"
    # Base has failed in all other pairs than regressions, and the table keeps its causes apart.
    cause = {("cause" if outcome == "regression" else "base_cause"): group.cause}
    known = {"event": group.event, "outcome": outcome if group.event else "", **cause}
    chosen = {name: value for name, value in known.items() if value} or {"outcome": outcome}
    return Card(
        number=group.number,
        cause=group.cause.replace("_", " "),
        what=group.what,
        view=urlencode(chosen),
        sentence=pair.sentence,
        case=urlencode({**chosen, "case": pair.item_id}),
        film=film,
        arms=arms,
    )
