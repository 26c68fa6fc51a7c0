"""The report as Markdown, for a repository or a pull request."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from urllib.parse import quote

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.report import base_failures, highlights
from pytest_libero_max.report.blocks import Result
from pytest_libero_max.report.columns import Table, columns_in, headings
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.published import BESIDE_TITLE, published_beside
from pytest_libero_max.report.report_document import BaseFailures, Report
from pytest_libero_max.report.sections import NOTES
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.studies.study_document import Study
from pytest_libero_max.report.studies.study_tables import study_notes, study_tables
from pytest_libero_max.report.writers import broken
from pytest_libero_max.report.writers.gate_text import GateRow, named_pairs
from pytest_libero_max.report.writers.summary import (
    ALL_PAIRS,
    FLOOR_NOTE,
    GIVEN_RESPONSE_NOTE,
    any_floor,
    chance_rows,
    clipping_text,
    group_label,
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
        lines += ["", f"## {BESIDE_TITLE}", "", beside.note, ""]
        lines += markdown_table(beside.head, beside.rows) if beside.rows else []
    lines += [
        "",
        f"## {highlights.TITLE}",
        "",
        *markdown_table(("What", "Where", "Value"), highlight_rows(report)),
    ]
    lines += ["", highlights.NOTE]
    for key, dimension in DIMENSIONS.items():
        if not report.by[key]:
            continue
        lines += ["", f"## {dimension.title}", "", *_groups("groups", dimension.title, report.by[key])]
    by_event = {**report.by["event"], ALL_PAIRS: report.overall}
    lines += ["", "## Coverage and stale actions", "", *_groups("coverage", "Event", by_event)]
    lines += ["", "## Given a query after the event", "", *_groups("given_response", "Event", by_event)]
    lines += ["", GIVEN_RESPONSE_NOTE]
    intervals = "Intervals are 95% and exact: Clopper-Pearson for rates, melded for changes. "
    lines += [
        "",
        f"{'' if stopped_texts(pairs) else intervals}Groups hold different",
        "cases: differences between them are descriptions, not effects.",
        "",
    ]
    lines += [] if report.study is None else _study(report.study)
    for title, values in report.sections.items():
        lines += [f"## {markdown_text(title)}", "", *([NOTES[title], ""] if title in NOTES else [])]
        lines += [*markdown_table(("Name", "Value"), values.items()), ""]
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


class _Written(str):
    """Text that is Markdown already."""


def markdown_text(text: object) -> str:
    """Return text as one line that holds no markup of HTML and no link."""
    if isinstance(text, _Written):
        return text
    words = printable(str(text)).replace("&", "&amp;").replace("<", "&lt;")
    return words.replace("](", "]\\(")


def _gates(gates: Sequence[GateRow]) -> list[str]:
    """Return the verdicts on gates, with the first of the pairs that count against one."""
    if not gates:
        return []
    rows = [
        (
            _Written(f"`{printable(gate.gate).replace('`', chr(39))}`"),
            _Written(f"**{gate.finding}**"),
            gate.value,
            f"{gate.why} Against it: {named_pairs(gate.lost)}.".strip() if gate.lost else gate.why,
        )
        for gate in gates
    ]
    return [*markdown_table(("Gate", "Verdict", "Value", "Why"), rows), ""]


def _quantities(report: Report) -> list[tuple[str, str]]:
    return [
        *((column.title, column.long(report.overall)) for column in columns_in("summary")),
        *chance_rows(report),
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
                _Written(f"`{printable(pair.item_id).replace('`', chr(39))}`"),
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
            _Written(f"`{printable(item).replace('`', chr(39))}`"),
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
    return _Written(f"[film]({quote(film)})") if film else ""


def _study(study: Study) -> list[str]:
    lines = [f"## Study: {markdown_text(study.title)}", ""]
    lines += [line for note in study_notes(study) for line in (markdown_text(note), "")]
    for table in study_tables(study):
        lines += [f"### {markdown_text(table.title)}", "", *markdown_table(table.head, table.rows), ""]
        lines += [markdown_text(table.note), ""] if table.note else []
    return lines


def _groups(table: Table, title: str, groups: Mapping[str, Result]) -> list[str]:
    """One row a group, and the note on groups whose Base success is too low."""
    columns = columns_in(table)
    rows = [
        (group_label(name, row), *(column.long(row) for column in columns)) for name, row in groups.items()
    ]
    note = ["", FLOOR_NOTE.replace("*", "\\*")] if any_floor(groups.values()) else []
    return [*markdown_table((title, *headings(table)), rows), *note]


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table."""
    body = [" | ".join(markdown_text(cell).replace("|", "\\|") for cell in row) for row in (head, *rows)]
    return [f"| {body[0]} |", "|" + " --- |" * len(head), *(f"| {row} |" for row in body[1:])]
