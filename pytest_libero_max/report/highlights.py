"""Highlights of a report: macro averages, extreme categories and the largest split, as rows of text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from pytest_libero_max.report.formats import counted, percent, points
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Rate
from pytest_libero_max.stats.breakdown import ByChance, lowest_by_chance, split_by_chance

TITLE = "Averages and extremes"

NOTE = (
    "Groups hold different cases, so these numbers describe the groups. Expected by chance: the mean if the "
    "outcomes are shuffled over the groups. A group stands out where fewer than 5% of the shuffles are as "
    "extreme. The unweighted mean over source categories is secondary to the results over all pairs. Below "
    "20% Base success, a small change or a gain does not show a response to the event."
)


def highlight_rows(report: Report) -> list[tuple[str, str, str]]:
    """Return rows of quantity, group and value; a row without a group says so."""
    return [*_macro(report), *_extremes(report), _split(report)]


def _macro(report: Report) -> list[tuple[str, str, str]]:
    macro = report.macro.category
    where = counted(macro.groups, "source category", "source categories")
    if macro.base_success is None:
        return [("Unweighted mean", where, "n/a: a category has no played pair")]
    change = f"{points(macro.paired_change)} pp"
    rates = f"{percent(macro.base_success)} to {percent(macro.dynamic_success)}"
    return [("Unweighted mean, Base to Dynamic", where, f"{rates}, {change}")]


def _extremes(report: Report) -> Iterator[tuple[str, str, str]]:
    categories = report.by["category"]
    for source in report.extremes:
        rows = {
            name: row for name, row in categories.items() if name.partition("-")[0] == source and row.played
        }
        base = {name: row.base_success.value or 0.0 for name, row in rows.items()}
        change = {name: row.paired_change.value or 0.0 for name, row in rows.items()}
        sizes = [row.played for row in rows.values()]
        successes = sum(row.base_success.count for row in rows.values())
        gains = sum(row.outcomes.change_associated_success for row in rows.values())
        losses = sum(row.outcomes.regression for row in rows.values())
        yield (
            f"Lowest Base success, {source}",
            *_lowest(base, lowest_by_chance(sizes, successes, 0, min(base.values())), percent),
        )
        yield (
            f"Lowest paired change, {source}",
            *_lowest(change, lowest_by_chance(sizes, gains, losses, min(change.values())), _points),
        )


def _lowest(values: Mapping[str, float], chance: ByChance, shown: Callable[[float], str]) -> tuple[str, str]:
    lowest = min(values.values())
    names = [name for name, value in values.items() if value == lowest]
    if len(values) == 1:
        return names[0], shown(lowest)
    expected = f"{shown(chance.expected)} expected by chance"
    if len(names) > 1 or chance.explains:
        return "none stands out", f"the lowest of {len(values)} is {shown(lowest)}; {expected}"
    return names[0], f"{shown(lowest)}, the lowest of {len(values)}; {expected}"


def _points(value: float) -> str:
    return f"{points(value)} pp"


def _split(report: Report) -> tuple[str, str, str]:
    title, split = "Largest split of Dynamic success", report.largest_split
    if split is None:
        return title, "n/a", "no event has two played parameter variants"
    events: dict[str, list[Rate]] = {}
    for name, row in report.by["variant"].items():
        if row.played:
            events.setdefault(name.rpartition("-")[0], []).append(row.dynamic_success)
    cells = [
        ([rate.of for rate in rates], sum(rate.count for rate in rates))
        for rates in events.values()
        if len(rates) > 1
    ]
    seen = split.difference or 0.0
    chance = split_by_chance(cells, seen)
    expected = f"{_points(chance.expected)} expected by chance"
    if chance.explains:
        return (
            title,
            "none stands out",
            f"the largest of {counted(len(cells), 'event')} is {_points(seen)}; {expected}",
        )
    rates_text = ", ".join(f"{name} {percent(rate)}" for name, rate in split.dynamic_success.items())
    return title, split.event, f"{_points(seen)} between its parameter variants ({rates_text}); {expected}"
