"""The figures that the paper prints, of policies beside each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pytest_libero_max.lab.comparisons.paper_rows import PolicyRow, Rates
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.plots import Drawable, Plot, Row, Scatter, rates_row, run_kind


def policy_arrows(rows: Sequence[PolicyRow]) -> Plot:
    """Return the success of every policy: a ring for Base, a dot for Dynamic."""
    shown = []
    for row in rows:
        rates = Rates.of(row.outcomes)
        text = f"{percent(rates.base)} to {percent(rates.dynamic)}, {points(rates.change)}"
        shown.append(rates_row(row.name, "", rates.base, rates.dynamic, text))
    head = ("Policy", "Base to Dynamic, change in pp")
    return Plot("Base to Dynamic success by policy", head, shown, signed=False)


_COVERAGE: tuple[tuple[str, str, Callable[[PolicyRow], float | None]], ...] = (
    ("gain", "retained", lambda row: row.outcomes.retained.value),
    ("loss", "Base successes lost", lambda row: row.outcomes.conditional_regression.value),
    ("neutral", "event fired", lambda row: None if row.trigger is None else row.trigger.value),
    ("event", "query after it", lambda row: None if row.response is None else row.response.value),
)


def coverage(rows: Sequence[PolicyRow]) -> Plot:
    """Return retained performance, lost Base successes, and both coverages of every policy."""
    known = [part for part in _COVERAGE if any(part[2](row) is not None for row in rows)]
    shown = []
    for row in rows:
        values = [(kind, of(row)) for kind, _, of in known]
        text = ", ".join("not published" if value is None else percent(value) for _, value in values)
        shown.append(Row(row.name, "", text, [(value, kind) for kind, value in values if value is not None]))
    head = ("Policy", ", ".join(name for _, name, _ in known))
    legend = [(kind, name) for kind, name, _ in known]
    title = "Retained performance, lost Base successes and coverage by policy"
    return Plot(title, head, shown, legend, signed=False)


def category_scatter(rows: Sequence[PolicyRow]) -> Scatter | None:
    """Return Base success and paired change of every policy in every source category; None where unknown."""
    known = [row for row in rows if row.by.get("category")]
    if not known:
        return None
    panels: dict[str, list[tuple[float, float, str]]] = {source: [] for source in known[0].by["source"]}
    for number, row in enumerate(known):
        for name, rates in row.by["category"].items():
            if rates.base is not None and rates.change is not None:
                panels[name.partition("-")[0]].append((rates.base, rates.change, run_kind(number)))
    return Scatter(
        "Paired change in percentage points by Base success, source categories",
        "Base success; a point is a source category",
        panels,
        [(run_kind(number), row.name) for number, row in enumerate(known)],
    )


PAPER_PLOTS: Mapping[str, tuple[Callable[[Sequence[PolicyRow]], Drawable | None], str]] = {
    "policy-arrows": (policy_arrows, "Base success (ring) and Dynamic success (dot)."),
    "coverage": (
        coverage,
        "Dynamic successes per Base success, Base successes that fail in Dynamic, pairs whose event fired, "
        "and pairs with a query after it.",
    ),
    "categories": (
        category_scatter,
        "Base success and paired change by source category. In the grey part Base success is below 20%: a "
        "small change says nothing about robustness there.",
    ),
}
"""Plots of policies by the stem of their file name, each with its caption. None where nothing is known."""
