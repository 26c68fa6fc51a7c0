"""The page of a run: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from urllib.parse import urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report import highlights, timing
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.formats import interval_text, points, rate_text
from pytest_libero_max.report.group_tables import ALL_PAIRS, group_table
from pytest_libero_max.report.measurable import lacks_of
from pytest_libero_max.report.page.broken_cards import broken_sections
from pytest_libero_max.report.page.charts import (
    category_map,
    contrasts,
    direction,
    forest,
    histogram,
    outcome_bar,
)
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.origin import origin_rows
from pytest_libero_max.report.page.page_frame import Viewed, page, page_table
from pytest_libero_max.report.published import published_beside
from pytest_libero_max.report.quantities import quantities_in
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import shown_sections
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.studies.study_tables import study_notes, study_tables
from pytest_libero_max.report.writers.figures import survival_curves
from pytest_libero_max.report.writers.gate_text import GateRow
from pytest_libero_max.report.writers.summary import (
    GIVEN_RESPONSE_NOTE,
    clipping_text,
    noise_rows,
    note_texts,
    selection_text,
    title_text,
)
from pytest_libero_max.runs.kept_fingerprint import fingerprint_text
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun
from pytest_libero_max.stats.blocks import Result

SHOWN_FIRST = (
    "base_success",
    "dynamic_success",
    "paired_change",
    "conditional_regression",
    "preserved_success",
    "change_associated_success",
    "regression",
    "persistent_failure",
    "played",
)
"""Quantities that the first screen shows; other tables have the others."""


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
    pairs, study = report.pairs, report.study
    faults = [(pair.item_id, pair.phase, pair.kind, pair.message) for pair in pairs.invalid_pairs]
    return page(
        "run.html",
        title_text(report),
        cases,
        report=report,
        pairs=pairs,
        broken=broken_sections(report, films or {}, _event_steps(stored)),
        parts=("Breakdowns", "Events", "Provenance") if pairs.played else ("Events", "Provenance"),
        alarms=report.warnings,
        notes=note_texts(report),
        gates=[(gate, gate.finding.replace(" ", "-"), _against(gate.lost)) for gate in gates],
        events=[] if stored is None else events_of(stored.run.planned, stored.records),
        regressions=regressions,
        replay=replay,
        replay_text=replay_text,
        pairs_name=pairs_name,
        films=films or {},
        study_notes=[] if study is None else study_notes(study),
        study_plot=contrasts(study.camera) if study is not None and study.camera and study.cases else None,
        study_figures=[svg for name, svg in study_figures(study).items() if name != "study-contrasts"],
        sections=[(part, [*map(page_table, part.tables)]) for part in shown_sections(report)],
        section_figures={timing.TITLE: survival_curves(report)},
        study_tables=[] if study is None else [*map(page_table, study_tables(study))],
        invalid_rows=faults,
        limits_title=LIMITS_TITLE,
        provenance=[*_provenance(report, stored)],
        beside=None if (beside := published_beside(report)) is None else page_table(beside),
        **(_results(report) if pairs.played else {}),
    )


def _results(report: Report) -> dict[str, Any]:
    """Return the values of the template for a run with played pairs."""
    overall, clipping = report.overall, clipping_text(report)
    remarks = [f"{title}: {text}" for title, text in noise_rows(report)]
    by_event = {ALL_PAIRS: overall, **report.by["event"]}
    given = page_table(group_table("given_response", "Event", by_event))
    change = overall.paired_change
    all_respond = overall.response_coverage.count == overall.played  # then the results are those above
    return {
        "verdict": _verdict(overall),
        "direction": direction(change),
        "change": f"{points(change.value)} pp",
        "interval": interval_text(change, signed=True),
        "rates": [
            (column.title, *_number_and_rest(rate_text(column.value(overall))))
            for column in quantities_in("groups")
            if column.key in ("base_success", "dynamic_success", "conditional_regression")
        ],
        "outcomes": outcome_bar(overall.outcomes),
        "forest": forest(overall, report.by["event"]),
        "quantities": [
            (column.title, column.long(overall))
            for column in quantities_in("summary")
            if column.key not in SHOWN_FIRST and not {"coverage", "given_response"} & {*column.tables}
        ],
        "category_map": category_map(report),
        "stale_histogram": histogram(overall.stale_actions.histogram),
        "coverage": page_table(group_table("coverage", "Event", by_event)),
        "remarks": remarks if clipping is None else [*remarks, clipping],
        "given_response_note": GIVEN_RESPONSE_NOTE,
        "given_response": None if all_respond else given,
        "highlights": highlights,
        "breakdowns": [
            (dimension.title, page_table(group_table("groups", dimension.title, report.by[key], key)))
            for key, dimension in DIMENSIONS.items()
            if report.by[key]
        ],
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


def _number_and_rest(text: str) -> tuple[str, str]:
    number, _, rest = text.partition(" ")
    return number, rest.strip()


def _event_steps(stored: StoredRun | None) -> dict[str, int]:
    """Return the policy steps before the event of each pair in which it happened, by item id."""
    records = () if stored is None else stored.records
    return {record.item_id: record.trigger.step for record in records if record.trigger is not None}


def _provenance(report: Report, stored: StoredRun | None) -> Iterator[tuple[str, str]]:
    origin = report.provenance
    if stored is not None:
        yield from origin_rows(report, stored)
    for name, version in origin["versions"].items():
        yield name, version or "not installed"
    yield "case set", f"{origin['case_set']['name']}, {origin['case_set']['digest'][:12]}"
    if "released_as" in origin["case_set"]:
        yield "case set is", origin["case_set"]["released_as"]
    if report.selection:
        yield "selection", f"{selection_text(report)}, {report.selection.digest[:12]}"
    yield "MUJOCO_GL", origin.get("gl_backend") or "not set"
    if "fingerprint" in origin:
        yield "fingerprint", fingerprint_text(origin)
    yield "command", shlex.join(origin["command"])
