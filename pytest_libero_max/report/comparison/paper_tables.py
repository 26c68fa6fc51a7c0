"""The tables that the LIBERO-MAX paper prints, for any policies; as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

from pytest_libero_max.report.blocks import Result
from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.comparison.comparison_document import ApartRun
from pytest_libero_max.report.comparison.paper_rows import PolicyRow, Rates
from pytest_libero_max.report.formats import tenths
from pytest_libero_max.report.measured import number
from pytest_libero_max.report.published import PartialPolicy
from pytest_libero_max.report.writers.markdown import markdown_table
from pytest_libero_max.report.writers.tables import latex_escaped, tabular
from pytest_libero_max.stats.paired_difference import paired_difference

UNITS = "Rates in percent, changes in percentage points."


class Value(NamedTuple):
    """A rate from 0 to 1, or with its sign a difference of rates."""

    value: float | None
    signed: bool = False


class Span(NamedTuple):
    """The ends of an interval of a difference of rates."""

    lower: float
    upper: float


Cell = str | int | Value | Span | None
"""What a table holds; None where nothing is known."""


@dataclass(frozen=True)
class PaperTable:
    """A table.

    Attributes:
        stem: Stem of its file names.
        title: Heading.
        head: Headings of the columns; the first one is of the rows.
        rows: Cells, the name of the row first.
        published: True for each row that is a result of the paper.
        note: Text below; empty for none.
    """

    stem: str
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    published: tuple[bool, ...]
    note: str = ""


Column = tuple[str, Callable[[PolicyRow], Cell]]


def paper_tables(rows: Sequence[PolicyRow]) -> list[PaperTable]:
    """Return the tables of policies; without columns of which nothing is known of any.

    Args:
        rows: Policies in the order of the tables, those of the paper last.
    """
    sources, categories = _groups(rows, "source"), _groups(rows, "category")
    return [
        *_table(rows, "policies", "Policies", [
            ("Kind", lambda row: row.family),
            ("Reported scale", lambda row: row.scale),
            ("H", lambda row: row.horizon),
            ("Q", lambda row: row.query_interval),
        ], "H is the chunk size, Q the execution horizon."),
        *_table(rows, "main", "Success by event family", [
            ("Base", lambda row: Value(row.outcomes.base.value)),
            ("Dynamic", lambda row: Value(row.outcomes.dynamic.value)),
            ("Change", lambda row: Value(row.outcomes.change.value, True)),
            ("95%", _interval),
            *_changes(rows, "family"),
        ], f"{UNITS} The interval is the melded exact one of the change. Columns of families are changes."),
        *_table(rows, "outcomes", "Paired outcomes (Base, Dynamic)", [
            ("Preserved (1,1)", lambda row: row.outcomes.preserved_success),
            ("Gained (0,1)", lambda row: row.outcomes.change_associated_success),
            ("Regressed (1,0)", lambda row: row.outcomes.regression),
            ("Failed (0,0)", lambda row: row.outcomes.persistent_failure),
            ("Pairs", lambda row: row.outcomes.total),
        ]),
        *_table(rows, "retained", "Retained performance, lost Base successes, and coverage", [
            ("Retained", lambda row: Value(row.outcomes.retained.value)),
            ("Base successes lost", lambda row: Value(row.outcomes.conditional_regression.value)),
            ("Event fired", lambda row: None if row.trigger is None else Value(row.trigger.value)),
            ("Query after it", lambda row: None if row.response is None else Value(row.response.value)),
        ], "Percent. Retained are Dynamic successes per Base success, newly solved cases included. Coverage "
        "is of all pairs."),
        *_table(rows, "events", "Paired change by event", _changes(rows, "event"), "Percentage points."),
        *_table(rows, "sources", "Success by source", [
            column
            for source in sources
            for column in (
                (f"{source} Base", _rate("source", source, lambda rates: Value(rates.base))),
                (f"{source} Dynamic", _rate("source", source, lambda rates: Value(rates.dynamic))),
                (f"{source} change", _rate("source", source, lambda rates: Value(rates.change, True))),
                (f"{source}, lowest Base", _extreme(source, lambda row: row.lowest_base)),
                (f"{source}, largest loss", _extreme(source, lambda row: row.largest_loss)),
            )
        ], f"{UNITS} The sources hold different tasks, so that their difference is no effect of the source. "
        "Of equal categories the first by name."),
        *_table(rows, "categories", "Success by source category", [
            column
            for category in categories
            for column in (
                (f"{_words(category)} Base", _rate("category", category, lambda rates: Value(rates.base))),
                (f"{_words(category)} change",
                 _rate("category", category, lambda rates: Value(rates.change, True))),
            )
        ], f"{UNITS} Below 20% Base success, a small change or a gain shows no response to the event."),
        *_table(rows, "suites", "Paired change by suite, and the mean over source categories", [
            ("Macro", lambda row: Value(row.macro, True)),
            *_changes(rows, "suite"),
        ], "Percentage points. Macro is the mean over the source categories, each with the same weight."),
        *_table(rows, "severity", "Paired change by severity, and the largest split", [
            *_changes(rows, "severity"),
            ("Largest split", lambda row: None if row.split is None else Value(row.split[1])),
            ("Event of it", lambda row: None if row.split is None else _words(row.split[0])),
        ], "Percentage points. The groups of severity hold different events. The split is the largest "
        "difference of Dynamic success between the two parameter variants of an event, which hold different "
        "cases: a description, no effect of the parameter."),
        *_table(rows, "lite", "Max and Lite", [
            (f"{track} {title}", _lite(track, part))
            for title, part in _PARTS.items()
            for track in ("Max", "Lite")
        ] if any(row.lite for row in rows) else [], f"{UNITS} {_agreement(rows)}"),
    ]  # fmt: skip


def partial_tables(runs: Sequence[ApartRun], published: PartialPolicy | None = None) -> list[PaperTable]:
    """Return a table of the policies that play a part of the suites, by suite; none without such a policy.

    Args:
        runs: Runs that are listed apart.
        published: Such a policy of the paper.
    """
    rows: list[tuple[Cell, ...]] = []
    for run in runs:
        by_suite = {suite: _measured(row) for suite, row in run.by_suite.items()}
        by_suite |= dict.fromkeys(run.unsupported_suites, Rates.printed(None, None, None))
        rows += _partial_rows(_policy_name(run.name, run.policy), by_suite, _measured(run.result))
    own = len(rows)
    if published is not None:
        printed = {suite: _printed(*values) for suite, values in published.by_suite.items()}
        rows += _partial_rows(published.name, printed, _printed(*published.total))
    head = ("Policy", "Suite", "Pairs", "Base", "Dynamic", "Change")
    note = f"{UNITS} These policies do not support all suites. They are in no other table and have no rank."
    title = "Policies that play a part of the suites"
    flags = tuple(index >= own for index in range(len(rows)))
    return [PaperTable("partial", title, head, tuple(rows), flags, note)] if rows else []


def _measured(row: Result) -> Rates:
    return Rates(row.played, row.base_success.value, row.dynamic_success.value, row.paired_change.value)


def _printed(pairs: float | None, *percents: float | None) -> Rates:
    return replace(Rates.printed(*percents), pairs=None if pairs is None else int(pairs))


def _partial_rows(name: str, by_suite: Mapping[str, Rates], total: Rates) -> Iterator[tuple[Cell, ...]]:
    for suite, rates in [*sorted(by_suite.items()), ("all supported", total)]:
        cells = (Value(rates.base), Value(rates.dynamic), Value(rates.change, True))
        yield name, suite, rates.pairs, *cells


def _policy_name(run: str, policy: Mapping[str, object] | None) -> str:
    return run if policy is None else f"{policy['name']} ({run})"


def _table(
    rows: Sequence[PolicyRow], stem: str, title: str, columns: Sequence[Column], note: str = ""
) -> Iterator[PaperTable]:
    found = [(head, [cell(row) for row in rows]) for head, cell in columns]
    known = [(head, cells) for head, cells in found if not all(map(_unknown, cells))]
    if known:
        yield PaperTable(
            stem,
            title,
            ("Policy", *(head for head, _ in known)),
            tuple((row.name, *(cells[index] for _, cells in known)) for index, row in enumerate(rows)),
            tuple(row.published for row in rows),
            note,
        )


def _unknown(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, Value) and cell.value is None)


def _groups(rows: Sequence[PolicyRow], dimension: str) -> list[str]:
    """Return the groups that a row has, in the order of reports."""
    names = {name for row in rows for name in row.by.get(dimension, {})}
    return sorted(names, key=lambda name: group_order(dimension, name))


def _rate(dimension: str, group: str, part: Callable[[Rates], Cell]) -> Callable[[PolicyRow], Cell]:
    def cell(row: PolicyRow) -> Cell:
        rates = row.by.get(dimension, {}).get(group)
        return None if rates is None else part(rates)

    return cell


def _changes(rows: Sequence[PolicyRow], dimension: str) -> list[Column]:
    return [
        (_words(group), _rate(dimension, group, lambda rates: Value(rates.change, True)))
        for group in _groups(rows, dimension)
    ]


def _extreme(source: str, part: Callable[[PolicyRow], Mapping[str, str]]) -> Callable[[PolicyRow], Cell]:
    def cell(row: PolicyRow) -> Cell:
        found = part(row).get(source)
        return None if found is None else _words(found.partition("-")[2])

    return cell


def _interval(row: PolicyRow) -> Cell:
    if not row.with_interval:
        return None
    found = paired_difference(
        row.outcomes.regression, row.outcomes.change_associated_success, row.outcomes.total
    )
    return None if found is None else Span(found.lower, found.upper)


_PARTS: Mapping[str, Callable[[Rates], Value]] = {
    "Base": lambda rates: Value(rates.base),
    "Dynamic": lambda rates: Value(rates.dynamic),
    "change": lambda rates: Value(rates.change, True),
}


def _lite(track: str, part: Callable[[Rates], Value]) -> Callable[[PolicyRow], Cell]:
    def cell(row: PolicyRow) -> Cell:
        rates = Rates.of(row.outcomes) if track == "Max" else row.lite
        return None if rates is None else part(rates)

    return cell


def _agreement(rows: Sequence[PolicyRow]) -> str:
    """Return how far Lite and Max agree: the largest difference, and the order of every two policies."""
    both = [(Rates.of(row.outcomes), row.lite) for row in rows if row.lite is not None]
    differences = [
        abs((part(lite).value or 0.0) - (part(whole).value or 0.0))
        for whole, lite in both
        for part in _PARTS.values()
    ]
    kept = [
        ((a.dynamic or 0) > (b.dynamic or 0)) == ((c.dynamic or 0) > (d.dynamic or 0))
        and ((a.dynamic or 0) < (b.dynamic or 0)) == ((c.dynamic or 0) < (d.dynamic or 0))
        for (a, c), (b, d) in combinations(both, 2)
    ]
    text = f"Largest difference {tenths(max(differences, default=0.0))}."
    return text if not kept else f"{text} {sum(kept)} of {len(kept)} orders by Dynamic success are the same."


def _words(name: str) -> str:
    return name.replace("_", " ")


def table_markdown(table: PaperTable) -> str:
    """Return a table as Markdown, results of the paper marked where there are others."""
    mixed = len({*table.published}) > 1
    rows = [
        (f"{row[0]} (paper)" if mixed and published else str(row[0]), *map(_text, row[1:]))
        for row, published in zip(table.rows, table.published, strict=True)
    ]
    parts = [f"## {table.title}", "\n".join(markdown_table(table.head, rows))]
    return "\n\n".join([*parts, *([table.note] if table.note else [])]) + "\n"


def table_csv(table: PaperTable) -> str:
    """Return a table as CSV: rates and changes as fractions, empty where nothing is known."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    spans = [any(isinstance(row[column], Span) for row in table.rows) for column in range(len(table.head))]
    heads = [
        [f"{head} lower", f"{head} upper"] if span else [head]
        for head, span in zip(table.head, spans, strict=True)
    ]
    writer.writerow(["From", *(name for names in heads for name in names)])
    for row, published in zip(table.rows, table.published, strict=True):
        cells = [_numbers(cell, span) for cell, span in zip(row, spans, strict=True)]
        writer.writerow(["paper" if published else "run", *(value for values in cells for value in values)])
    return buffer.getvalue()


def table_latex(table: PaperTable, comments: Sequence[str]) -> str:
    """Return a table as a LaTeX ``tabular``, a line between one's own rows and those of the paper.

    Args:
        table: The table.
        comments: Lines above it, below its title.
    """
    columns = [
        "l" if all(isinstance(row[column], str | None) for row in table.rows) else "r"
        for column in range(len(table.head))
    ]
    ruled = table.published.index(True) if True in table.published else 0
    above = [table.title, *comments, *([table.note] if table.note else [])]
    rows = [[_latex(cell) for cell in row] for row in table.rows]
    return tabular(above, "".join(columns), table.head, rows, ruled)


def _text(cell: Cell) -> str:
    if isinstance(cell, Span):
        return f"[{tenths(cell.lower, True)}, {tenths(cell.upper, True)}]"
    if isinstance(cell, Value):
        return "--" if cell.value is None else tenths(cell.value, cell.signed)
    return "--" if cell is None else str(cell)


def _latex(cell: Cell) -> str:
    if isinstance(cell, Span):
        return f"[${tenths(cell.lower, True)}$, ${tenths(cell.upper, True)}$]"
    if isinstance(cell, Value) and cell.value is not None and cell.signed:
        return f"${tenths(cell.value, True)}$"
    return latex_escaped(_text(cell))


def _numbers(cell: Cell, span: bool) -> list[object]:
    if isinstance(cell, Span):
        return [number(cell.lower), number(cell.upper)]
    if isinstance(cell, Value):
        return ["" if cell.value is None else number(cell.value)]
    return ["", ""] if span else ["" if cell is None else cell]
