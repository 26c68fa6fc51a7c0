"""The page of a run: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from urllib.parse import urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.gate_rows import GateRow
from pytest_libero_max.report.measurable import warning_of
from pytest_libero_max.report.page.broken_cards import broken_cards
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.first_screen import facts, first_screen, heading
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.page.words import words
from pytest_libero_max.report.plots import COLOURS_NOTE, Viewed
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import BROKEN, GATES, run_document
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun


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
        regressions: Item ids of the pairs that succeed in Base and fail in Dynamic.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        stored: The run, for its events and its origin; None leaves these out.
        cases: Result of :func:`~pytest_libero_max.report.page.case_table.run_cases`;
            None leaves it out.
        pairs_name: The file of the pairs beside the page.
        gates: Verdicts on the gates that the run was given.
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
