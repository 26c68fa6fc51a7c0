"""The columns of a report: every quantity once, with its title, its place and how it is printed.

Every writer (terminal, Markdown, HTML, CSV, LaTeX) and the gates read this table. To add a quantity that is
in the report, add an entry here. Any other is a field of
:class:`~pytest_libero_max.stats.blocks.Result` first, filled in :mod:`~pytest_libero_max.stats.measured`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from pytest_libero_max.report.formats import (
    Change,
    Format,
    IntervalByTask,
    Number,
    PairCount,
    PValue,
    Rate,
    Share,
    Text,
)
from pytest_libero_max.stats.blocks import Result

R = TypeVar("R")

TEXT = Text()


class Cell(NamedTuple):
    """A number of a table, with the way in which it is printed."""

    value: Any
    """The number, or a block with its counts and interval."""
    format: Format

    @property
    def has_interval(self) -> bool:
        return self.format.numbers(self.value).get("_lower") is not None


INTERVAL_MARK = " [95%]"
"""End of a heading of numbers with their intervals, where some have one."""

TableKind = Literal["summary", "groups", "narrow", "runs", "coverage", "given_response"]
"""The tables of a report.

``summary``: every quantity of the whole run, one a row. ``groups``: one row a group, for pages.
``narrow``: one row a group, for the terminal and LaTeX. ``runs``: one row a run. ``coverage``: trigger and
response coverage, one row an event. ``given_response``: results over the pairs with a query after the event,
one row an event.
"""


@dataclass(frozen=True)
class Line:
    """Place of a quantity in the terminal summary."""

    title: str
    """Beginning of the line. Columns with the same title share a line, in the order of the table."""
    mark: str = ""
    """Text before the value, for all but the first quantity of a line."""
    short: bool = False
    """True to print the value as in narrow tables."""
    optional: bool = False
    """True to leave the quantity out where it has no number."""


@dataclass(frozen=True)
class Quantity(Generic[R]):
    """One quantity of a row of the report.

    A row is the result of a set of pairs: ``report.overall`` or a group such as
    ``report.by["event"].camera_shift``.
    """

    key: str
    """Name in CSV files; columns with an interval have ``KEY_lower`` and ``KEY_upper`` as well."""
    title: str
    value: Callable[[R], Any]
    """Returns the quantity of a row."""
    format: Format
    heading: str = ""
    """Heading in narrow tables; the title where it is empty."""
    tables: tuple[TableKind, ...] = ("summary",)
    """Tables that have it. CSV files hold every column."""
    line: Line | None = None
    """Place in the terminal summary; None for none."""
    gate: str | None = ""
    """Name as a quantity of gates; the key where it is empty, None where no gate can ask for it."""
    of_change: bool = False
    """True for what the event changed, which needs pairs that can show it (see
    :mod:`pytest_libero_max.report.measurable`)."""

    def long(self, row: R) -> str:
        return self.format.long(self.value(row))

    def short(self, row: R) -> str:
        return self.format.short(self.value(row))

    def cell(self, row: R) -> Cell:
        return Cell(self.value(row), self.format)

    def numbers(self, row: R) -> dict[str, float | None]:
        return {self.key + end: number for end, number in self.format.numbers(self.value(row)).items()}

    @property
    def short_heading(self) -> str:
        return self.heading or self.title


_LOST = "Base successes lost"
_OUTCOMES = "Who succeeds"
_FIRED = "Event fired"
_STALE = "Stale actions until next query"

QUANTITIES: tuple[Quantity[Result], ...] = (
    Quantity("planned", "Pairs planned", lambda row: row.planned, Number(), tables=(), gate=None),
    Quantity(
        "played", "Pairs played", lambda row: row, PairCount(), "Pairs",
        tables=("summary", "groups", "narrow", "coverage"), gate=None,
    ),
    Quantity(
        "base_success", "Base success", lambda row: row.base_success, Rate(), "Base",
        tables=("summary", "groups", "narrow", "runs"), line=Line("Base success"), gate="base_sr",
    ),
    Quantity(
        "dynamic_success", "Dynamic success", lambda row: row.dynamic_success, Rate(), "Dynamic",
        tables=("summary", "groups", "narrow", "runs"), line=Line("Dynamic success"), gate="dynamic_sr",
    ),
    Quantity(
        "paired_change", "Paired change", lambda row: row.paired_change, Change(), f"Change{INTERVAL_MARK}",
        tables=("summary", "groups", "narrow", "runs"), line=Line("Paired change"), gate="delta",
        of_change=True,
    ),
    Quantity(
        "p_value", "Exact McNemar", lambda row: row.mcnemar, PValue(), line=Line("Paired change", "McNemar"),
        of_change=True,
    ),
    Quantity(
        "log10_p_value", "Exact McNemar, log10 of p", lambda row: row.mcnemar.log10_p_value, Number(".2f"),
        tables=(), gate=None,
    ),
    Quantity(
        "paired_change_by_task", "Paired change, interval by task", lambda row: row.paired_change.by_task,
        IntervalByTask(), "95% by task", line=Line("Paired change by task"), gate="delta.clustered",
        of_change=True,
    ),
    *(
        Quantity(
            f"{key}_by_task", f"{title}, interval by task", value, IntervalByTask(signed=False),
            line=Line("Rates by task", mark, True, optional=True), gate=f"{gate}.clustered",
            of_change=of_change,
        )
        for key, title, value, mark, gate, of_change in (
            ("base_success", "Base success", lambda row: row.by_task.base_success, "Base", "base_sr", False),
            (
                "dynamic_success", "Dynamic success", lambda row: row.by_task.dynamic_success, "Dynamic",
                "dynamic_sr", False,
            ),
            (
                "conditional_regression", _LOST, lambda row: row.by_task.conditional_regression, "lost",
                "conditional_regression", True,
            ),
        )
    ),
    Quantity(
        "preserved_success", "Preserved successes (1,1)", lambda row: row.outcomes.preserved_success,
        Number(), line=Line(_OUTCOMES, "P both"),
    ),
    Quantity(
        "change_associated_success", "Change-associated successes (0,1)",
        lambda row: row.outcomes.change_associated_success, Number(), line=Line(_OUTCOMES, "G only Dynamic"),
        gate="gains",
    ),
    Quantity(
        "regression", "Regressions (1,0)", lambda row: row.outcomes.regression, Number(),
        line=Line(_OUTCOMES, "R only Base"), gate="regressions", of_change=True,
    ),
    Quantity(
        "persistent_failure", "Persistent failures (0,0)", lambda row: row.outcomes.persistent_failure,
        Number(), line=Line(_OUTCOMES, "N none"),
    ),
    Quantity(
        "conditional_regression", _LOST, lambda row: row.conditional_regression, Rate(counted=True), "Lost",
        tables=("summary", "groups", "narrow", "runs"), line=Line(_LOST), of_change=True,
    ),
    Quantity(
        "retained", "Dynamic successes per Base success", lambda row: row.retained, Share(),
        line=Line(_LOST, "retained", short=True), of_change=True,
    ),
    Quantity(
        "trigger_coverage", _FIRED, lambda row: row.trigger_coverage, Rate(counted=True),
        tables=("summary", "coverage"), line=Line(_FIRED, short=True),
    ),
    Quantity(
        "response_coverage", "Query after the event", lambda row: row.response_coverage, Rate(counted=True),
        tables=("summary", "coverage"), line=Line(_FIRED, "query after it", short=True),
    ),
    Quantity(
        "stale_mean", "Stale actions, mean", lambda row: row.stale_actions.mean, Number(".2f"),
        tables=("summary", "coverage"), line=Line(_STALE, "mean"),
    ),
    Quantity(
        "stale_median", "Stale actions, median", lambda row: row.stale_actions.median, Number("g"),
        tables=("summary", "coverage"), line=Line(_STALE, "median"),
    ),
    Quantity(
        "given_response_base_success", "Base success, given a query after the event",
        lambda row: row.given_response.base_success, Share(), "Base success",
        tables=("summary", "given_response"),
    ),
    Quantity(
        "given_response_dynamic_success", "Dynamic success, given a query after the event",
        lambda row: row.given_response.dynamic_success, Share(), "Dynamic success",
        tables=("summary", "given_response"),
    ),
    Quantity(
        "given_response_paired_change", "Paired change, given a query after the event",
        lambda row: row.given_response.paired_change, Share(signed=True), "Paired change",
        tables=("summary", "given_response"), of_change=True,
    ),
)  # fmt: skip
"""Every column, in the order of all tables."""


def quantities_in(table: TableKind) -> tuple[Quantity[Any], ...]:
    """Return the columns of a table, in their order."""
    return tuple(column for column in QUANTITIES if table in column.tables)


def quantity(key: str) -> Quantity[Any]:
    """Return a quantity by its key."""
    return next(one for one in QUANTITIES if one.key == key)
