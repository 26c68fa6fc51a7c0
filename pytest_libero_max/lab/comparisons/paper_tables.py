"""The tables that the LIBERO-MAX paper prints, for any policies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

from pytest_libero_max.lab.comparisons.paper_rows import PolicyRow, Rates
from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.comparison.comparison_document import ApartRun
from pytest_libero_max.report.document import Table, table_of
from pytest_libero_max.report.formats import MISSING, Format, Interval, Tenths, tenths
from pytest_libero_max.report.published import PartialPolicy
from pytest_libero_max.report.quantities import TEXT, Quantity
from pytest_libero_max.stats.blocks import Result
from pytest_libero_max.stats.intervals import Interval as Ends
from pytest_libero_max.stats.paired_difference import paired_difference

UNITS = "Rates in percent, changes in percentage points."

_RATE, _CHANGE = Tenths(signed=False, missing=MISSING), Tenths(missing=MISSING)

Column = Quantity[PolicyRow]

_ORIGIN: Column = Quantity("from", "From", lambda row: _origin_of(published=row.published), TEXT)
"""Tells published rows from those of runs."""

_OUTCOME_TITLES = ("Preserved (1,1)", "Gained (0,1)", "Regressed (1,0)", "Failed (0,0)")

_PARTS: tuple[tuple[str, str, Format], ...] = (
    ("base", "Base", _RATE),
    ("dynamic", "Dynamic", _RATE),
    ("change", "change", _CHANGE),
)
"""Fields of :class:`.Rates`, with their titles and formats."""


def paper_tables(rows: Sequence[PolicyRow]) -> list[Table]:
    """Return the tables of policies, those of the paper last; without columns of which nothing is known."""
    mixed = len({row.published for row in rows}) > 1
    named = [(row.name, row) for row in rows]
    origin = [_ORIGIN] if any(row.published for row in rows) else []
    apart = sum(not row.published for row in rows) if mixed else 0
    tables = []
    for key, (title, columns, note) in _tables(rows).items():
        known = [
            column
            for column in columns
            if any(number is not None for row in rows for number in column.numbers(row).values())
        ]
        if known:
            tables.append(
                table_of(title, "Policy", [*origin, *known], named, note=note, key=key, apart=apart)
            )
    return tables


def _origin_of(*, published: bool) -> str:
    return "paper" if published else "run"


def _tables(rows: Sequence[PolicyRow]) -> dict[str, tuple[str, Sequence[Column], str]]:
    """Return title, columns and note of the tables by the stem of their file names."""
    return {
        "policies": ("Policies", [
            Quantity("family", "Kind", lambda row: row.family, TEXT),
            Quantity("scale", "Reported scale", lambda row: row.scale, TEXT),
            Quantity("horizon", "H", lambda row: row.horizon, TEXT),
            Quantity("query_interval", "Q", lambda row: row.query_interval, TEXT),
        ], "H is the chunk size, Q the execution horizon."),
        "main": ("Success by event family", [
            Quantity("base_success", "Base", lambda row: row.outcomes.base.value, _RATE),
            Quantity("dynamic_success", "Dynamic", lambda row: row.outcomes.dynamic.value, _RATE),
            Quantity("paired_change", "Change", lambda row: row.outcomes.change.value, _CHANGE),
            Quantity("paired_change", "95%", _interval, Interval()),
            *_by_group(rows, "family", "change"),
        ], f"{UNITS} 95%: the melded exact interval of the change. Columns of families are changes."),
        "outcomes": ("Paired outcomes (Base, Dynamic)", [
            *(
                Quantity(key, title, lambda row, key=key: getattr(row.outcomes, key), TEXT)  # type: ignore[misc]
                for key, title in zip(OUTCOMES, _OUTCOME_TITLES, strict=True)
            ),
            Quantity("pairs", "Pairs", lambda row: row.outcomes.total, TEXT),
        ], ""),
        "retained": ("Retained performance, lost Base successes, and coverage", [
            Quantity("retained", "Retained", lambda row: row.outcomes.retained.value, _RATE),
            Quantity(
                "conditional_regression", "Base successes lost",
                lambda row: row.outcomes.conditional_regression.value, _RATE,
            ),
            Quantity("trigger_coverage", "Event fired", lambda row: row.trigger and row.trigger.value, _RATE),
            Quantity(
                "response_coverage", "Query after it", lambda row: row.response and row.response.value, _RATE
            ),
        ], "Percent. Retained are Dynamic successes per Base success, newly solved cases included. Coverage "
        "is of all pairs."),
        "events": ("Paired change by event", [*_by_group(rows, "event", "change")], "Percentage points."),
        "sources": ("Success by source", [*_sources(rows)],
            f"{UNITS} The sources hold different tasks, so that their difference is no effect of the source. "
            "Of equal categories the first by name."),
        "categories": ("Success by source category", [*_by_group(rows, "category", "base", "change")],
            f"{UNITS} Below 20% Base success, a small change or a gain shows no response to the event."),
        "suites": ("Paired change by suite, and the mean over source categories", [
            Quantity("macro", "Macro", lambda row: row.macro, _CHANGE),
            *_by_group(rows, "suite", "change"),
        ], "Percentage points. Macro is the mean over the source categories, each with the same weight."),
        "severity": ("Paired change by severity, and the largest split", [
            *_by_group(rows, "severity", "change"),
            Quantity("split", "Largest split", lambda row: row.split and row.split[1], _RATE),
            Quantity("split_event", "Event of it", lambda row: row.split and _words(row.split[0]), TEXT),
        ], "Percentage points. The groups of severity hold different events. The split is the largest "
        "difference of Dynamic success between the two parameter variants of an event, which hold different "
        "cases: a description, no effect of the parameter."),
        "lite": ("Max and Lite", [*_lite(rows)], f"{UNITS} {_agreement(rows)}"),
    }  # fmt: skip


def _by_group(rows: Sequence[PolicyRow], dimension: str, *parts: str) -> Iterator[Column]:
    """Yield parts of the rates of every group that a row has; a change alone needs no word for it."""
    names = {name for row in rows for name in row.by.get(dimension, {})}
    for group in sorted(names, key=lambda name: group_order(dimension, name)):
        title = "{group}" if parts == ("change",) else "{group} {part}"
        yield from _rates(f"{dimension}.{group}", title, _words(group), parts, _in_group(dimension, group))


def _in_group(dimension: str, group: str) -> Callable[[PolicyRow], Rates | None]:
    return lambda row: row.by.get(dimension, {}).get(group)


def _rates(
    key: str, title: str, group: str, parts: Sequence[str], rates: Callable[[PolicyRow], Rates | None]
) -> Iterator[Column]:
    def value(part: str) -> Callable[[PolicyRow], float | None]:
        return lambda row: getattr(rates(row), part, None)

    for part, word, form in _PARTS:
        if part in parts:
            yield Quantity(f"{key}.{part}", title.format(group=group, part=word), value(part), form)


def _sources(rows: Sequence[PolicyRow]) -> Iterator[Column]:
    for source in sorted({name for row in rows for name in row.by.get("source", {})}):
        parts = [part for part, _, _ in _PARTS]
        yield from _rates(f"source.{source}", "{group} {part}", source, parts, _in_group("source", source))
        lowest, largest = (
            _category(source, lambda row: row.lowest_base),
            _category(source, lambda row: row.largest_loss),
        )
        yield Quantity(f"source.{source}.lowest_base", f"{source}, lowest Base", lowest, TEXT)
        yield Quantity(f"source.{source}.largest_loss", f"{source}, largest loss", largest, TEXT)


def _category(
    source: str, names: Callable[[PolicyRow], Mapping[str, str]]
) -> Callable[[PolicyRow], str | None]:
    return lambda row: _words(names(row).get(source, "").partition("-")[2]) or None


def _lite(rows: Sequence[PolicyRow]) -> Iterator[Column]:
    if not any(row.lite for row in rows):
        return
    tracks: Mapping[str, Callable[[PolicyRow], Rates | None]] = {
        "Max": lambda row: Rates.of(row.outcomes),
        "Lite": lambda row: row.lite,
    }
    for part, _, _ in _PARTS:
        for track, rates in tracks.items():
            yield from _rates(track.lower(), "{group} {part}", track, [part], rates)


def _interval(row: PolicyRow) -> Ends | None:
    outcomes = row.outcomes
    interval = paired_difference(outcomes.regression, outcomes.change_associated_success, outcomes.total)
    return interval if row.with_interval else None


def _agreement(rows: Sequence[PolicyRow]) -> str:
    """Return how far Lite and Max agree: the largest difference, and the order of every two policies."""
    both = [(Rates.of(row.outcomes), row.lite) for row in rows if row.lite is not None]
    differences = [
        abs((getattr(lite, part) or 0.0) - (getattr(whole, part) or 0.0))
        for whole, lite in both
        for part, _, _ in _PARTS
    ]
    kept = [
        ((a.dynamic or 0) > (b.dynamic or 0)) == ((c.dynamic or 0) > (d.dynamic or 0))
        and ((a.dynamic or 0) < (b.dynamic or 0)) == ((c.dynamic or 0) < (d.dynamic or 0))
        for (a, c), (b, d) in combinations(both, 2)
    ]
    text = f"Largest difference {tenths(max(differences, default=0.0))}."
    return text if not kept else f"{text} {sum(kept)} of {len(kept)} orders by Dynamic success are the same."


_SuiteRow = tuple[str, Rates, bool]
"""A suite, a policy's rates there, and True for results of the paper."""


def partial_tables(runs: Sequence[ApartRun], published: PartialPolicy | None = None) -> list[Table]:
    """Return a table by suite of policies that play a part of the suites; none without such a policy."""
    rows: list[tuple[str, Any]] = []
    for run in runs:
        by_suite = {suite: _measured(row) for suite, row in run.by_suite.items()}
        by_suite |= dict.fromkeys(run.unsupported_suites, Rates(None, None, None, None))
        name = run.name if run.policy is None else f"{run.policy['name']} ({run.name})"
        rows += _suites(name, by_suite, _measured(run.result), published=False)
    apart = len(rows)
    if published is not None:
        printed = {suite: Rates.printed(*values) for suite, values in published.by_suite.items()}
        rows += _suites(published.name, printed, Rates.printed(*published.total), published=True)
    origin: Quantity[_SuiteRow] = Quantity("from", "From", lambda row: _origin_of(published=row[2]), TEXT)
    columns: list[Quantity[_SuiteRow]] = [
        *([] if published is None else [origin]),
        Quantity("suite", "Suite", lambda row: row[0], TEXT),
        Quantity("pairs", "Pairs", lambda row: row[1].pairs, TEXT),
        Quantity("base_success", "Base", lambda row: row[1].base, _RATE),
        Quantity("dynamic_success", "Dynamic", lambda row: row[1].dynamic, _RATE),
        Quantity("paired_change", "Change", lambda row: row[1].change, _CHANGE),
    ]
    note = f"{UNITS} These policies do not support all suites. They are in no other table and have no rank."
    title = "Policies that play a part of the suites"
    table = table_of(title, "Policy", columns, rows, note=note, key="partial", apart=apart)
    return [table] if rows else []


def _measured(row: Result) -> Rates:
    return Rates(row.played, row.base_success.value, row.dynamic_success.value, row.paired_change.value)


def _suites(
    name: str, by_suite: Mapping[str, Rates], total: Rates, *, published: bool
) -> Iterator[tuple[str, _SuiteRow]]:
    for suite, rates in [*sorted(by_suite.items()), ("all supported", total)]:
        yield name, (suite, rates, published)


def _words(name: str) -> str:
    return name.replace("_", " ")
