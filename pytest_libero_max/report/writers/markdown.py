"""The report as Markdown, for a repository or a pull request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from urllib.parse import quote

from pytest_libero_max.report import base_failures, highlights
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.group_tables import ALL_PAIRS, group_table
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.published import published_beside
from pytest_libero_max.report.quantities import quantities_in
from pytest_libero_max.report.render.markdown import (
    Written,
    code,
    markdown_table,
    markdown_text,
    section_markdown,
    table_markdown,
)
from pytest_libero_max.report.report_document import BaseFailures, Report
from pytest_libero_max.report.sections import shown_sections
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.studies.study_document import (
    Study,
)
from pytest_libero_max.report.studies.study_tables import study_notes, study_tables
from pytest_libero_max.report.writers import broken
from pytest_libero_max.report.writers.gate_text import GateRow, named_pairs
from pytest_libero_max.report.writers.summary import (
    GIVEN_RESPONSE_NOTE,
    clipping_text,
    noise_rows,
    note_texts,
    stopped_texts,
    title_text,
)
from pytest_libero_max.runs.kept_fingerprint import fingerprint_text


def markdown(report: Report, films: Mapping[str, str] | None = None, gates: Sequence[GateRow] = ()) -> str:
    """Render a report; ends with a newline.

    Args:
        report: The report.
        films: Path of the film of each pair that has one, relative to the file, by item id.
        gates: Verdicts on the gates that the run was given.
    """
    provenance, pairs = report.provenance, report.pairs
    lines = [f"# {markdown_text(title_text(report))}", ""]
    for text in report.warnings:
        lines += [f"**{markdown_text(text)}**", ""]
    if report.substrate.note:
        lines += [markdown_text(report.substrate.note), ""]
    if notes := note_texts(report):
        lines += [*(f"- {markdown_text(text)}" for text in notes), ""]
    clipping = clipping_text(report)
    if clipping is not None:
        lines += [clipping, ""]
    lines += _gates(gates)
    lines += markdown_table(("Quantity", "Value"), _quantities(report))
    lines += _broken(report, films or {})
    beside = published_beside(report)
    if beside is not None:
        lines += ["", f"## {beside.title}", "", beside.note, ""]
        lines += markdown_table(beside.headings(), beside.texts()) if beside.rows else []
    lines += [
        "",
        f"## {highlights.TITLE}",
        "",
        *markdown_table(("What", "Where", "Value"), highlight_rows(report)),
    ]
    lines += ["", highlights.NOTE]
    by_event = {**report.by["event"], ALL_PAIRS: report.overall}
    tables = {
        dimension.title: group_table("groups", dimension.title, report.by[key], key)
        for key, dimension in DIMENSIONS.items()
        if report.by[key]
    }
    tables["Coverage and stale actions"] = group_table("coverage", "Event", by_event)
    tables["Given a query after the event"] = group_table("given_response", "Event", by_event)
    for title, table in tables.items():
        lines += ["", f"## {title}", "", table_markdown(table)]
    lines += ["", GIVEN_RESPONSE_NOTE]
    intervals = "Intervals are 95% and exact: Clopper-Pearson for rates, melded for changes. "
    lines += [
        "",
        f"{'' if stopped_texts(pairs) else intervals}Groups hold different",
        "cases: differences between them are descriptions, not effects.",
        "",
    ]
    lines += [] if report.study is None else _study(report.study)
    for section in shown_sections(report):
        lines += [section_markdown(section), ""]
    lines += [
        f"## {LIMITS_TITLE}",
        "",
        *(f"- {markdown_text(text)}" for text in report.statements.values()),
    ]
    lines += ["", "## Provenance", ""]
    versions = [(name, version or "not installed") for name, version in provenance["versions"].items()]
    digests = [("case set", provenance["case_set"]["digest"])]
    if "released_as" in provenance["case_set"]:
        digests.append(("case set is", provenance["case_set"]["released_as"]))
    if report.selection:
        digests.append(("selected cases", report.selection.digest))
    if "fingerprint" in provenance:
        digests.append(("fingerprint", fingerprint_text(provenance)))
    lines += markdown_table(("Part", "Version"), [*versions, *digests])
    return "\n".join(lines) + "\n"


def _gates(gates: Sequence[GateRow]) -> list[str]:
    """Return the verdicts on gates, with the first of the pairs that count against one."""
    if not gates:
        return []
    rows = [
        (
            code(gate.gate),
            Written(f"**{gate.finding}**"),
            gate.value,
            f"{gate.why} Against it: {named_pairs(gate.lost)}.".strip() if gate.lost else gate.why,
        )
        for gate in gates
    ]
    return [*markdown_table(("Gate", "Verdict", "Value", "Why"), rows), ""]


def _quantities(report: Report) -> list[tuple[str, str]]:
    return [
        *((column.title, column.long(report.overall)) for column in quantities_in("summary")),
        *noise_rows(report),
    ]


def _broken(report: Report, films: Mapping[str, str]) -> list[str]:
    """Return the pairs whose outcome changed, a part of them by name."""
    lines: list[str] = []
    unknown = broken.without_causes(report)
    head = ["", "Pair", "Event", "Pairs like it" if unknown else "Cause (pairs)"]
    head += ([] if unknown else ["What happened"]) + (["Film"] if films else [])
    if base := base_failures.known_failures(report):
        lines += _base(report, base, films)
    for outcome, letter in broken.LETTERS.items():
        rows = [
            [
                letter,
                code(pair.item_id),
                group.what,
                *([len(group.pairs)] if unknown else [f"{group.cause} ({len(group.pairs)})", pair.sentence]),
                *([_film_link(films.get(pair.item_id))] if films else []),
            ]
            for group in broken.groups_of(report.changed_pairs, outcome)
            for pair in group.named
        ]
        if rows:
            lines += ["", f"## {broken.title_of(report, outcome)}", "", *markdown_table(head, rows)]
            more = broken.count_of(report, outcome) - len(rows)
            lines += ["", f"{more} more: `changed_pairs` of report.json, and report.html."] if more else []
    return [*lines, "", broken.NO_CAUSES] if lines and unknown else lines


def _base(report: Report, groups: Sequence[BaseFailures], films: Mapping[str, str]) -> list[str]:
    """Return the failures of Base by cause, and what to do next."""
    rows = [
        [
            group.pairs,
            group.cause,
            code(item),
            group.sentence if item == group.item_ids[0] else "",
            *([_film_link(films.get(item))] if films else []),
        ]
        for group in groups
        for item in [base_failures.shown_pair(group, films)]
    ]
    head = ["Pairs", "Cause", "Pair", "What happened", *(["Film"] if films else [])]
    title, step = base_failures.title_of(report), base_failures.next_step(report)
    return ["", f"## {title}", "", markdown_text(step), "", *markdown_table(head, rows)]


def _film_link(film: str | None) -> str:
    return Written(f"[film]({quote(film)})") if film else ""


def _study(study: Study) -> list[str]:
    lines = [f"## Study: {markdown_text(study.title)}", ""]
    lines += [line for note in study_notes(study) for line in (markdown_text(note), "")]
    for table in study_tables(study):
        lines += [table_markdown(table, 3), ""]
    return lines
