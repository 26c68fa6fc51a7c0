"""The page of a run: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.formats import interval_text, points, rate_text
from pytest_libero_max.report.measurable import lacks_of
from pytest_libero_max.report.page.broken_cards import broken_cards
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.plots import Viewed, direction, outcome_bar
from pytest_libero_max.report.quantities import quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import BROKEN, GATES, run_document
from pytest_libero_max.report.run_plots import forest
from pytest_libero_max.report.writers.gate_text import GateRow
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun
from pytest_libero_max.stats.blocks import Result

_FIRST = ("base_success", "dynamic_success", "conditional_regression")
"""Rates of the first screen."""


def html(
    report: Report,
    regressions: Sequence[str],
    replay: Sequence[str],
    films: Mapping[str, Sequence[str]] | None = None,
    stored: StoredRun | None = None,
    cases: Json | None = None,
    pairs_name: str = PAIRS_NAME,
    gates: Sequence[GateRow] = (),
) -> str:
    """Render a report as a page.

    Args:
        report: Result of :func:`~pytest_libero_max.report.build.build_report`.
        regressions: Item ids of the pairs that succeed in Base and fail in Dynamic.
        replay: Result of :func:`~pytest_libero_max.runs.replay_command.replay_command`.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        stored: The run, for its events and its origin; None leaves these out.
        cases: Result of :func:`~pytest_libero_max.report.page.case_table.run_cases`;
            None leaves it out.
        pairs_name: The file of the pairs beside the page.
        gates: Verdicts on the gates that the run was given.
    """
    pairs = report.pairs
    return document_page(
        "run.html",
        run_document(report, gates=gates, stored=stored),
        cases,
        own_way=(GATES, BROKEN),
        pairs=pairs,
        substrate=report.substrate.note,
        broken=broken_cards(report, films or {}, _event_steps(stored)),
        parts=("Breakdowns", "Events", "Provenance") if pairs.played else ("Events", "Provenance"),
        gates=[(gate, gate.finding.replace(" ", "-"), _against(gate.lost)) for gate in gates],
        events=[] if stored is None else events_of(stored.run.planned, stored.records),
        regressions=regressions,
        replay=replay,
        replay_text=replay_text,
        pairs_name=pairs_name,
        films=films or {},
        **(_headline(report) if pairs.played else {}),
    )


def _headline(report: Report) -> dict[str, Any]:
    """Return the values of the first screen of a run with played pairs."""
    overall = report.overall
    change = overall.paired_change
    rates = [quantity(key) for key in _FIRST]
    return {
        "verdict": _verdict(overall),
        "direction": direction(change),
        "change": f"{points(change.value)} pp",
        "interval": interval_text(change, signed=True),
        "rates": [(one.title, *rate_text(one.value(overall)).split(" ", 1)) for one in rates],
        "outcomes": outcome_bar(overall.outcomes),
        "forest": forest(report),
    }


def _against(lost: Sequence[str]) -> tuple[Viewed, str] | None:
    """Return the first pair that counts against a gate, and the number of the others in words."""
    if not lost:
        return None
    more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
    return Viewed(lost[0], urlencode({"case": lost[0]})), more


def _verdict(overall: Result) -> str:
    """Return what the paired change shows, in words."""
    if lacks_of(overall):
        return "These pairs cannot show what the events do; see the note above."
    if overall.played and overall.paired_change.lower is None:
        return "A rule stopped this run: it has no interval, but what the rule knows."
    return {
        "loss": "Success falls when the event happens.",
        "gain": "Success rises when the event happens.",
        "neutral": "No change of success is shown: the interval holds 0.",
    }[direction(overall.paired_change)]


def _event_steps(stored: StoredRun | None) -> dict[str, int]:
    """Return the policy steps before the event of each pair in which it happened, by item id."""
    records = () if stored is None else stored.records
    return {record.item_id: record.trigger.step for record in records if record.trigger is not None}
