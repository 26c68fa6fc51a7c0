"""Highlights of a report: macro averages, extreme categories and the largest split, as rows of text."""

from __future__ import annotations

from pytest_libero_max.report.formats import change_text, percent, points, rate_text
from pytest_libero_max.report.report_document import Report

TITLE = "Averages and extremes"

NOTE = (
    "Groups hold different cases, so these describe the groups. The unweighted mean over source "
    "categories is secondary to the results over all pairs. Below 20% Base success, a small change or a "
    "gain does not show a successful response to the event."
)


def highlight_rows(report: Report) -> list[tuple[str, str, str]]:
    """Return rows of quantity, group and value; a row without a group says so."""
    return [*_macro(report), *_extremes(report), _split(report)]


def _macro(report: Report) -> list[tuple[str, str, str]]:
    macro = report.macro.category
    where = f"{macro.groups} source categories"
    if macro.base_success is None:
        return [("Unweighted mean", where, "n/a: a category has no played pair")]
    change = f"{points(macro.paired_change)} pp"
    rates = f"{percent(macro.base_success)} to {percent(macro.dynamic_success)}"
    return [("Unweighted mean, Base to Dynamic", where, f"{rates}, {change}")]


def _extremes(report: Report) -> list[tuple[str, str, str]]:
    rows = []
    for source, extremes in report.extremes.items():
        lowest, loss = extremes.lowest_base_success, extremes.largest_loss
        categories = report.by["category"]
        rows += [
            (f"Lowest Base success, {source}", lowest, rate_text(categories[lowest].base_success)),
            (f"Lowest paired change, {source}", loss, change_text(categories[loss].paired_change)),
        ]
    return rows


def _split(report: Report) -> tuple[str, str, str]:
    split = report.largest_split
    if split is None:
        return "Largest split of Dynamic success", "n/a", "no event has two played parameter variants"
    rates = ", ".join(f"{name} {percent(rate)}" for name, rate in split.dynamic_success.items())
    return (
        "Largest split of Dynamic success",
        split.event,
        f"{100 * (split.difference or 0.0):.1f} pp between its parameter variants ({rates})",
    )
