"""The page of a run: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from urllib.parse import quote, urlencode

from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import Group, Part, parts_of
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import with_short_names
from pytest_libero_max.report.formats import count_text, counted, interval_text, percent, points
from pytest_libero_max.report.gate_text import GateRow
from pytest_libero_max.report.happenings import arm_title
from pytest_libero_max.report.measurable import lacks_of, warning_of
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.page.words import words
from pytest_libero_max.report.plots import COLOURS_NOTE, Viewed, direction, outcome_bar
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import BROKEN, GATES, run_document
from pytest_libero_max.report.run_plots import forest
from pytest_libero_max.report.run_texts import cases_title, returned_text
from pytest_libero_max.runs.media import filmed_arms
from pytest_libero_max.runs.provenance import commit_text
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun
from pytest_libero_max.stats.blocks import Result


class CopyButton(NamedTuple):
    """A button that copies a command."""

    title: str
    command: str
    place: str


def heading(report: Report) -> str:
    """Return the policy and its cases, without the letters of its cadence."""
    spec = report.policy
    name = spec["name"] if spec is not None else report.provenance["policy"]["reference"]
    return f"{name} on {cases_title(report)}"


def facts(report: Report) -> Iterator[str]:
    """Yield what was played, when, from which commit, and how the policy was asked."""
    pairs, origin, spec = report.pairs, report.provenance, report.policy
    yield f"{pairs.played} of {pairs.planned} planned pairs played"
    if started := origin.get("started"):
        yield started[:10]
    if git := origin.get("git"):
        yield f"commit {commit_text(git)}"
    if spec is None:
        return
    if spec.get("revision"):
        yield f"revision {spec['revision']}"
    returned = returned_text(report.returned, spec["horizon"])
    yield f"{counted(spec['horizon'], 'action')} a query{returned}, {spec['query_interval']} of them executed"
    if spec["privileged"]:
        yield "reads the simulator"
    if "control" in spec:
        yield f"{spec['control']} control"
    yield from spec.get("wrappers", ())
    if not spec.get("repeatable", True):
        yield "not repeatable"


def first_screen(report: Report, earlier: Comparison | None = None) -> dict[str, Any]:
    """Return the values of the first screen of a run with played pairs, by their names in the template."""
    overall = report.overall
    change, lost = overall.paired_change, overall.conditional_regression
    lacks = lacks_of(overall)
    groups = [overall, *report.by["event"].values()]
    return {
        "verdict": _verdict(overall),
        "measurable": not lacks,
        "direction": direction(change),
        "change": f"{points(change.value)} pp",
        "interval": interval_text(change, signed=True),
        "rates": [
            (arm, meaning, percent(rate.value), count_text(rate))
            for arm, meaning, rate in (
                ("Base", "no event", overall.base_success),
                ("Dynamic", "the event happens", overall.dynamic_success),
            )
        ],
        "lost": (count_text(lost), interval_text(lost)),
        "gained": f"{overall.outcomes.change_associated_success}/{overall.played - lost.of}",
        "outcomes": outcome_bar(overall.outcomes),
        "forest": forest(report) if any(not lacks_of(group) for group in groups) else None,
        "regressions_of_run": overall.outcomes.regression,
        "since": None if earlier is None else _since(earlier),
        "buttons": [*_buttons(report)],
    }


def _verdict(overall: Result) -> str:
    base, dynamic = percent(overall.base_success.value), percent(overall.dynamic_success.value)
    if lacks := lacks_of(overall):
        return f"These pairs cannot show what the event does: {'; '.join(lacks)}."
    if overall.paired_change.lower is None:
        return f"Success is {base} without the event and {dynamic} with it, where a rule stopped this run."
    return {
        "loss": f"Success falls from {base} to {dynamic} when the event happens.",
        "gain": f"Success rises from {base} to {dynamic} when the event happens.",
        "neutral": f"No change is shown: success is {base} without the event and {dynamic} with it, and the "
        "interval of the change holds 0.",
    }[direction(overall.paired_change)]


def _since(earlier: Comparison) -> str:
    """Return what changed since an earlier run, and whether the runs differ in more than their outcomes."""
    (contrast,) = with_short_names(structs.replace(earlier, flips=[])).contrasts
    difference = contrast.difference
    text = (
        f"Since {contrast.first}: Dynamic success {points(difference.value)} pp "
        f"{interval_text(difference, signed=True)}, {counted(contrast.first_only, 'case')} lost and "
        f"{contrast.second_only} won of {contrast.cases}."
    )
    if earlier.differences or earlier.policies:
        text += " The runs differ in more: see libero-max compare."
    return text


def _buttons(report: Report) -> Iterator[CopyButton]:
    yield CopyButton("Copy compare", "libero-max compare OTHER_RUN .", "in the folder of this page")
    command = shlex.join(report.provenance["command"])
    yield CopyButton("Copy command", command, "in the folder in which the run was started")


def html(
    report: Report,
    regressions: Sequence[str],
    replay: Sequence[str],
    films: Mapping[str, Sequence[str]] | None = None,
    stored: StoredRun | None = None,
    cases: Json | None = None,
    pairs_name: str = PAIRS_NAME,
    gates: Sequence[GateRow] = (),
    earlier: Comparison | None = None,
) -> str:
    """Render a report as a page.

    Args:
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        earlier: The comparison of an earlier run with this one, if there was one to compare with.
    """
    pairs = report.pairs
    played = {} if stored is None else {record.item_id: record for record in stored.records}
    document = run_document(report, gates=gates, stored=stored)
    warning = warning_of(report.overall)  # which the verdict of the first screen says
    return document_page(
        "run.html",
        replace(document, warnings=[text for text in document.warnings if text != warning]),
        cases,
        own_way=(GATES, BROKEN),
        lead=0,
        heading=heading(report),
        facts=[*facts(report)],
        pairs=pairs,
        substrate=report.substrate.note,
        broken=broken_cards(report, films or {}, played),
        gates=[(gate, gate.finding.replace(" ", "-"), _against(gate.lost)) for gate in gates],
        events=[] if stored is None else events_of(stored.run.planned, stored.records),
        regressions=regressions,
        replay=replay,
        replay_text=replay_text,
        pairs_name=pairs_name,
        films=films or {},
        words=words(),
        colours_note=COLOURS_NOTE,
        **(first_screen(report, earlier) if pairs.played else {}),
    )


def _against(lost: Sequence[str]) -> tuple[Viewed, str] | None:
    """Return the first pair that counts against a gate, and the number of the others in words."""
    if not lost:
        return None
    more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
    return Viewed(lost[0], urlencode({"case": lost[0]})), more


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
