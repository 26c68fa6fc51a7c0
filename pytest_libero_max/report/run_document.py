"""The report of a run as a document, which Markdown and the page show."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from pytest_libero_max.report import highlights, timing
from pytest_libero_max.report.broken import broken_sections
from pytest_libero_max.report.document import Code, Document, Section, Strong, Table
from pytest_libero_max.report.formats import IntervalByTask, lack_of_tasks
from pytest_libero_max.report.gate_text import GateRow, named_pairs
from pytest_libero_max.report.groups import ALL_PAIRS, DIMENSIONS, group_table
from pytest_libero_max.report.page.origin import origin_rows
from pytest_libero_max.report.published import published_beside
from pytest_libero_max.report.quantities import quantities_in
from pytest_libero_max.report.render.drawing import survival_curves
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_plots import category_map, stale_actions
from pytest_libero_max.report.run_texts import GIVEN_RESPONSE_NOTE, clipping_text, note_texts, title_text
from pytest_libero_max.report.sections import shown_sections
from pytest_libero_max.report.studies.study_document import Study
from pytest_libero_max.report.studies.study_figures import study_plots
from pytest_libero_max.report.studies.study_tables import study_notes, study_tables
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats.blocks import Result

GATES, BROKEN, BREAKDOWNS, PROVENANCE = "gates", "broken", "breakdowns", "provenance"
"""Keys of sections. A page shows the first two in another way."""


def run_document(
    report: Report,
    films: Mapping[str, str] | None = None,
    gates: Sequence[GateRow] = (),
    stored: StoredRun | None = None,
) -> Document:
    """Return the report of a run as a document."""
    notes = [report.substrate.note, report.inference.text, *note_texts(report), clipping_text(report)]
    return Document(
        title_text(report),
        report.warnings,
        [text for text in notes if text],
        [*_sections(report, films or {}, gates), _provenance(report, stored)],
        statements=[*report.statements.values()],
    )


def _sections(report: Report, films: Mapping[str, str], gates: Sequence[GateRow]) -> Iterator[Section]:
    if gates:
        yield Section("Gates", [_gates(gates)], key=GATES)
    if report.overall.played:
        yield from _results(report, films)
    if report.pairs.invalid_pairs:
        faults = [(Code(one.item_id), one.phase, one.kind, one.message) for one in report.pairs.invalid_pairs]
        yield Section("Invalid pairs", [Table("", ("Pair", "Phase", "Error", "Message"), faults)])
    for section in shown_sections(report):
        curves = [survival_curves(report.success_curves)] if section.title == timing.TITLE else []
        yield replace(section, plots=[*section.plots, *curves])


def _results(report: Report, films: Mapping[str, str]) -> Iterator[Section]:
    """Yield the sections on the pairs that were played, of which there is one at least."""
    overall = report.overall
    yield _all_pairs(overall)
    yield from (replace(section, key=BROKEN) for section in broken_sections(report, films))
    if report.study is not None:
        yield _study(report.study)
    if (beside := published_beside(report)) is not None:
        tables = [replace(beside, title="", note="")] if beside.rows else []
        yield Section(beside.title, tables, lead=beside.note)
    about = "Paired change in percentage points. Cells hold different cases and describe them."
    yield Section("Source categories", lead=about, plots=[category_map(report)], folded=True)
    by_event = {**report.by["event"], ALL_PAIRS: overall}
    coverage = group_table("coverage", "Event", by_event)
    yield Section("Coverage and stale actions", [coverage], plots=[stale_actions(report)], folded=True)
    given = group_table("given_response", "Event", by_event)
    yield Section("Given a query after the event", [given], lead=GIVEN_RESPONSE_NOTE, folded=True)
    what = Table("", ("What", "Where", "Value"), highlights.highlight_rows(report))
    yield Section(highlights.TITLE, [what], lead=highlights.NOTE, folded=True)
    yield _breakdowns(report)


def _all_pairs(overall: Result) -> Section:
    """Return every quantity over all pairs; a note says once why there are no intervals by task."""
    rows, lacks = [], []
    for one in quantities_in("summary"):
        if isinstance(one.format, IntervalByTask) and one.value(overall).lower is None:
            lacks.append(lack_of_tasks(one.value(overall)))
        else:
            rows.append((one.title, one.cell(overall)))
    note = f"No interval by task: {'; '.join(dict.fromkeys(lacks))}." if lacks else ""
    return Section("All pairs", [Table("", ("Quantity", "Value"), rows, note)])


def _gates(gates: Sequence[GateRow]) -> Table:
    rows = [
        (
            Code(gate.gate),
            Strong(gate.finding),
            gate.value,
            f"{gate.why} Against it: {named_pairs(gate.lost)}.".strip() if gate.lost else gate.why,
        )
        for gate in gates
    ]
    return Table("", ("Gate", "Verdict", "Value", "Why"), rows)


def _breakdowns(report: Report) -> Section:
    tables = [
        replace(group_table("groups", dimension.title, report.by[key], key), title=dimension.title)
        for key, dimension in DIMENSIONS.items()
        if report.by[key]
    ]
    intervals = "Intervals are 95% and exact: Clopper-Pearson for rates, melded for changes. "
    note = "Groups hold different cases: differences between them are descriptions, not effects."
    lead = intervals + note if report.pairs.has_intervals else note
    return Section("Breakdowns", tables, lead=lead, key=BREAKDOWNS, folded=True)


def _study(study: Study) -> Section:
    title, plots = f"Study: {study.title}", [*study_plots(study).values()]
    return Section(title, study_tables(study), lead=" ".join(study_notes(study)), plots=plots)


def _provenance(report: Report, stored: StoredRun | None) -> Section:
    rows = [*_origin(report)]
    if stored is not None:  # what is of one machine, which a published page need not have
        origin = report.provenance
        rows = [*origin_rows(report, stored), *rows, ("MUJOCO_GL", origin.get("gl_backend") or "not set")]
        rows.append(("command", shlex.join(origin["command"])))
    return Section("Provenance", [Table("", ("Part", "Version"), rows)], key=PROVENANCE, folded=True)


def _origin(report: Report) -> Iterator[tuple[str, str]]:
    origin, case_set = report.provenance, report.provenance["case_set"]
    for name, version in origin["versions"].items():
        yield name, version or "not installed"
    yield "case set", case_set["name"]
    yield "digest of the case set", case_set["digest"]
    if "released_as" in case_set:
        yield "case set is", case_set["released_as"]
    if report.selection:
        yield "selection", report.selection.text
        yield "digest of the selection", report.selection.digest


def markdown(report: Report, films: Mapping[str, str] | None = None, gates: Sequence[GateRow] = ()) -> str:
    """Render a report; see :func:`.run_document`."""
    return document_markdown(run_document(report, films, gates))
