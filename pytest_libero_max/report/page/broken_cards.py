"""Pairs that broke or were gained as cards of a page: a card a cause and event, with a film where one is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from urllib.parse import quote, urlencode

from pytest_libero_max.report.broken import Group, Part, parts_of
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.worlds.contract import CONTROL_HZ

_MOST_CARDS = 8

_AFTER_EVENT_S = 0.1
"""Time in a film at which it shows the event, also with half of its frames."""


class Card(NamedTuple):
    """Pairs of one cause under one event."""

    number: int
    cause: str
    """In words; empty where it was not recorded."""
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


class Cards(NamedTuple):
    """The pairs of an outcome."""

    part: Part
    """Their groups, with the heading."""
    cards: Sequence[Card]
    """The largest groups."""
    more: int
    """Number of pairs in other groups."""
    view: str


def broken_cards(
    report: Report, films: Mapping[str, Sequence[str]], event_steps: Mapping[str, int]
) -> list[Cards]:
    """Return what Base fails at where it solves little, then the pairs that were lost and that were gained.

    Args:
        report: Of the run.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        event_steps: Policy steps before the event, by item id.
    """
    parts = parts_of(report, films, most=10**6, most_groups=_MOST_CARDS)
    return [
        Cards(
            part,
            [_card(part.outcome, group, films, event_steps) for group in part.groups if group.named],
            sum(group.number for group in part.groups if not group.named),
            urlencode({"outcome": part.outcome}),
        )
        for part in parts
    ]


def _card(
    outcome: str, group: Group, films: Mapping[str, Sequence[str]], event_steps: Mapping[str, int]
) -> Card:
    pair = next((pair for pair in group.named if pair.item_id in films), group.named[0])
    film = ""
    if pair.item_id in films:
        film = quote(films[pair.item_id][0])
        if group.event:  # the film begins at the event; a failure in Base has none
            film += f"#t={event_steps.get(pair.item_id, 0) / CONTROL_HZ + _AFTER_EVENT_S:g}"
    known = {"event": group.event, "outcome": outcome, "cause": group.cause}
    chosen = {name: value for name, value in known.items() if value}
    if not group.event:  # the causes of the table of cases are those of Dynamic, if it failed as well
        chosen = {"outcome": outcome}
    return Card(
        number=group.number,
        cause=group.cause.replace("_", " "),
        what=group.what,
        view=urlencode(chosen),
        sentence=pair.sentence,
        case=urlencode({**chosen, "case": pair.item_id} if group.event else {"case": pair.item_id}),
        film=film,
    )
