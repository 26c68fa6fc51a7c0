"""The tables that the LIBERO-MAX paper prints, for any policies; as Markdown, CSV and LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.comparison.comparison_document import ApartRun
from pytest_libero_max.report.comparison.paper_rows import PolicyRow, Rates
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.formats import MISSING, Interval, Tenths, tenths
from pytest_libero_max.report.published import PartialPolicy
from pytest_libero_max.report.quantities import Cell
from pytest_libero_max.report.render.markdown import table_markdown
from pytest_libero_max.report.render.tables import table_csv, table_latex
from pytest_libero_max.stats.blocks import Result
from pytest_libero_max.stats.paired_difference import paired_difference

UNITS = "Rates in percent, changes in percentage points."


_RATE, _CHANGE = Tenths(signed=False, missing=MISSING), Tenths(missing=MISSING)

Value = Cell | str | int | None
"""What a table holds; None where nothing is known."""


def _share(value: float | None) -> Cell:
    return Cell(value, _RATE)


def _points(value: float | None) -> Cell:
    return Cell(value, _CHANGE)


@dataclass(frozen=True, kw_only=True)
class PaperTable(Table):
    """A table of policies."""

    stem: str
    """Stem of its file names."""
    published: tuple[bool, ...]
    """True for each row that is a result of the paper."""


Column = tuple[str, Callable[[PolicyRow], Value]]


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
            ("Base", lambda row: _share(row.outcomes.base.value)),
            ("Dynamic", lambda row: _share(row.outcomes.dynamic.value)),
            ("Change", lambda row: _points(row.outcomes.change.value)),
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
            ("Retained", lambda row: _share(row.outcomes.retained.value)),
            ("Base successes lost", lambda row: _share(row.outcomes.conditional_regression.value)),
            ("Event fired", lambda row: None if row.trigger is None else _share(row.trigger.value)),
            ("Query after it", lambda row: None if row.response is None else _share(row.response.value)),
        ], "Percent. Retained are Dynamic successes per Base success, newly solved cases included. Coverage "
        "is of all pairs."),
        *_table(rows, "events", "Paired change by event", _changes(rows, "event"), "Percentage points."),
        *_table(rows, "sources", "Success by source", [
            column
            for source in sources
            for column in (
                (f"{source} Base", _rate("source", source, lambda rates: _share(rates.base))),
                (f"{source} Dynamic", _rate("source", source, lambda rates: _share(rates.dynamic))),
                (f"{source} change", _rate("source", source, lambda rates: _points(rates.change))),
                (f"{source}, lowest Base", _extreme(source, lambda row: row.lowest_base)),
                (f"{source}, largest loss", _extreme(source, lambda row: row.largest_loss)),
            )
        ], f"{UNITS} The sources hold different tasks, so that their difference is no effect of the source. "
        "Of equal categories the first by name."),
        *_table(rows, "categories", "Success by source category", [
            column
            for category in categories
            for column in (
                (f"{_words(category)} Base", _rate("category", category, lambda rates: _share(rates.base))),
                (f"{_words(category)} change",
                 _rate("category", category, lambda rates: _points(rates.change))),
            )
        ], f"{UNITS} Below 20% Base success, a small change or a gain shows no response to the event."),
        *_table(rows, "suites", "Paired change by suite, and the mean over source categories", [
            ("Macro", lambda row: _points(row.macro)),
            *_changes(rows, "suite"),
        ], "Percentage points. Macro is the mean over the source categories, each with the same weight."),
        *_table(rows, "severity", "Paired change by severity, and the largest split", [
            *_changes(rows, "severity"),
            ("Largest split", lambda row: None if row.split is None else _share(row.split[1])),
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
    rows: list[tuple[Value, ...]] = []
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
    return [PaperTable(title, head, rows, note, stem="partial", published=flags)] if rows else []


def _measured(row: Result) -> Rates:
    return Rates(row.played, row.base_success.value, row.dynamic_success.value, row.paired_change.value)


def _printed(pairs: float | None, *percents: float | None) -> Rates:
    return replace(Rates.printed(*percents), pairs=None if pairs is None else int(pairs))


def _partial_rows(name: str, by_suite: Mapping[str, Rates], total: Rates) -> Iterator[tuple[Value, ...]]:
    for suite, rates in [*sorted(by_suite.items()), ("all supported", total)]:
        cells = (_share(rates.base), _share(rates.dynamic), _points(rates.change))
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
            title,
            ("Policy", *(head for head, _ in known)),
            [(row.name, *(cells[index] for _, cells in known)) for index, row in enumerate(rows)],
            note,
            stem=stem,
            published=tuple(row.published for row in rows),
        )


def _unknown(cell: Value) -> bool:
    return cell is None or (isinstance(cell, Cell) and cell.value is None)


def _groups(rows: Sequence[PolicyRow], dimension: str) -> list[str]:
    """Return the groups that a row has, in the order of reports."""
    names = {name for row in rows for name in row.by.get(dimension, {})}
    return sorted(names, key=lambda name: group_order(dimension, name))


def _rate(dimension: str, group: str, part: Callable[[Rates], Value]) -> Callable[[PolicyRow], Value]:
    def cell(row: PolicyRow) -> Value:
        rates = row.by.get(dimension, {}).get(group)
        return None if rates is None else part(rates)

    return cell


def _changes(rows: Sequence[PolicyRow], dimension: str) -> list[Column]:
    return [
        (_words(group), _rate(dimension, group, lambda rates: _points(rates.change)))
        for group in _groups(rows, dimension)
    ]


def _extreme(source: str, part: Callable[[PolicyRow], Mapping[str, str]]) -> Callable[[PolicyRow], Value]:
    def cell(row: PolicyRow) -> Value:
        found = part(row).get(source)
        return None if found is None else _words(found.partition("-")[2])

    return cell


def _interval(row: PolicyRow) -> Value:
    outcomes = row.outcomes
    interval = paired_difference(outcomes.regression, outcomes.change_associated_success, outcomes.total)
    return None if interval is None or not row.with_interval else Cell(interval, Interval())


_PARTS: Mapping[str, Callable[[Rates], Cell]] = {
    "Base": lambda rates: _share(rates.base),
    "Dynamic": lambda rates: _share(rates.dynamic),
    "change": lambda rates: _points(rates.change),
}


def _lite(track: str, part: Callable[[Rates], Cell]) -> Callable[[PolicyRow], Value]:
    def cell(row: PolicyRow) -> Value:
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


def paper_markdown(table: PaperTable) -> str:
    """Return a table as Markdown, results of the paper marked where there are others."""
    mixed = len({*table.published}) > 1
    rows = [
        (f"{row[0]} (paper)" if mixed and published else row[0], *row[1:])
        for row, published in zip(table.rows, table.published, strict=True)
    ]
    return table_markdown(replace(table, rows=rows))


def paper_csv(table: PaperTable) -> str:
    """Return a table as CSV; its first column says which rows are of the paper."""
    rows = [
        ("paper" if published else "run", *row)
        for row, published in zip(table.rows, table.published, strict=True)
    ]
    return table_csv(replace(table, head=("From", *table.head), rows=rows))


def paper_latex(table: PaperTable, comments: Sequence[str]) -> str:
    """Return a table as LaTeX, a line between one's own rows and those of the paper."""
    ruled = table.published.index(True) if True in table.published else 0
    return table_latex(table, [table.title, *comments, *([table.note] if table.note else [])], ruled)
