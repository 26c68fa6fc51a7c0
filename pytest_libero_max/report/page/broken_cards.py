"""Pairs that broke or were gained as cards of a page: a card a cause and event, with a film where one is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from urllib.parse import quote, urlencode

from pytest_libero_max.report import base_failures
from pytest_libero_max.report.base_failures import MOST_CAUSES, known_failures, next_step
from pytest_libero_max.report.diagnosis import NOT_RECORDED
from pytest_libero_max.report.report_document import BaseFailures, Report
from pytest_libero_max.report.writers.broken import LETTERS, Group, groups_of, title_of
from pytest_libero_max.worlds.contract import CONTROL_HZ

_MOST = {"regression": 8, "change_associated_success": 4}
"""Number of cards of an outcome."""

_AFTER_EVENT_S = 0.1
"""Time in a film at which it shows the event, also with half of its frames."""


class Card(NamedTuple):
    """Pairs of one cause under one event."""

    outcome: str
    """Their outcome, which is the class of their colour."""
    number: int
    """Number of pairs."""
    cause: str
    """In words; empty where it was not recorded."""
    event: str
    """The event, with the programs that were played in its place."""
    view: str
    """View of the table of cases that has them alone."""
    sentence: str
    """What happened in the pair that is shown; empty where that was not recorded."""
    case: str
    """View of the table that shows this pair."""
    film: str
    """Address of its film, from just after the event; empty without one."""


class Section(NamedTuple):
    """The pairs of an outcome."""

    title: str
    """Heading."""
    cards: Sequence[Card]
    """The largest groups."""
    more: int
    """Number of pairs in other groups."""
    view: str
    """View of the table of cases with all of them."""
    note: str = ""
    """What to do next; empty for nothing."""


def broken_sections(
    report: Report, films: Mapping[str, Sequence[str]], event_steps: Mapping[str, int]
) -> list[Section]:
    """Return what Base fails at where it solves little, then the pairs that were lost and that were gained.

    Nothing is said of an outcome without pairs.

    Args:
        report: Of the run.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        event_steps: Policy steps before the event, by item id.
    """
    sections = []
    if base := known_failures(report):
        view = urlencode({"outcome": "persistent_failure"})
        cards = [_base_card(group, films, view) for group in base[:MOST_CAUSES]]
        more = sum(group.pairs for group in base[MOST_CAUSES:])
        sections.append(Section(base_failures.title_of(report), cards, more, view, next_step(report)))
    for outcome in LETTERS:
        groups = groups_of(report.changed_pairs, outcome)
        if groups:
            shown, others = groups[: _MOST[outcome]], groups[_MOST[outcome] :]
            cards = [_card(outcome, group, films, event_steps) for group in shown]
            more = sum(len(group.pairs) for group in others)
            sections.append(Section(title_of(report, outcome), cards, more, urlencode({"outcome": outcome})))
    return sections


def _base_card(group: BaseFailures, films: Mapping[str, Sequence[str]], view: str) -> Card:
    item = base_failures.shown_pair(group, films)
    return Card(
        outcome="persistent_failure",
        number=group.pairs,
        cause=group.cause.replace("_", " "),
        event="in Base",
        view=view,
        sentence=group.sentence if item == group.item_ids[0] else "",
        case=urlencode({"case": item}),
        film=quote(films[item][0]) if item in films else "",
    )


def _card(
    outcome: str, group: Group, films: Mapping[str, Sequence[str]], event_steps: Mapping[str, int]
) -> Card:
    known = group.cause != NOT_RECORDED
    pair = next((pair for pair in group.pairs if pair.item_id in films), group.pairs[0])
    film = ""
    if pair.item_id in films:
        begin = event_steps.get(pair.item_id, 0) / CONTROL_HZ + _AFTER_EVENT_S
        film = f"{quote(films[pair.item_id][0])}#t={begin:g}"
    chosen = {"event": group.event, "outcome": outcome} | ({"cause": group.cause} if known else {})
    return Card(
        outcome=outcome,
        number=len(group.pairs),
        cause=group.cause.replace("_", " ") if known else "",
        event=group.what,
        view=urlencode(chosen),
        sentence=pair.sentence if known else "",
        case=urlencode({**chosen, "case": pair.item_id}),
        film=film,
    )
