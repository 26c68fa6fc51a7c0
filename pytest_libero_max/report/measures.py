"""Quantities of the sections of a report: numbers with their units, which writers print and gates ask for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, ClassVar

from pytest_libero_max.report.document import Table
from pytest_libero_max.report.formats import (
    AMOUNT,
    COUNT,
    DIFFERENCE,
    NUMBER,
    P_VALUE,
    PERCENT,
    POINTS,
    SHARE,
    Format,
    Unit,
)
from pytest_libero_max.report.quantities import TEXT, Cell
from pytest_libero_max.stats import ratios
from pytest_libero_max.stats.blocks import MeanDifference, Measure, Rate, Ratio
from pytest_libero_max.stats.intervals import Interval, median_interval
from pytest_libero_max.stats.measured import number, rate_of, table_change_of, tabulate

Plain = str | int | float | bool | None
Rows = dict[str, Measure | Plain]
"""A section: what its rows are called, and their values."""


UNITS: Mapping[str, Unit] = {
    "share": PERCENT,
    "change": POINTS,
    "steps": Unit(AMOUNT, text=" steps"),
    "more steps": Unit(NUMBER, signed=True, text=" steps"),
    "m": Unit(AMOUNT, 2, text=" m"),
    "m/s^3": Unit(AMOUNT, text=" m/s^3"),
    "times": Unit(AMOUNT, 2),
    "cases": Unit(COUNT, 0),
    "p": Unit(P_VALUE, 3),
}
"""Units by the name that measures have in the report."""


def measure_text(measure: Measure) -> str:
    """Return a measure for people: value, interval, counts; and why a number lacks."""
    unit = UNITS[measure.unit]
    text = unit.amount(measure.value)
    if measure.lower is not None and measure.upper is not None:
        text += f" {unit.ends(measure)}"
    elif measure.lack:
        text += f": {measure.lack}" if measure.value is None else f" [n/a: {measure.lack}]"
    pairs = " pairs" * (unit.scale not in (SHARE, DIFFERENCE))
    return text if measure.of is None else f"{text}  {measure.count}/{measure.of}{pairs}"


@dataclass(frozen=True)
class _AsMeasured(Format):
    """A measure with its interval and its counts; None for none."""

    has_interval: ClassVar[bool] = True

    def long(self, value: Measure) -> str:
        return measure_text(value)

    def numbers(self, value: Measure | None) -> dict[str, float | None]:
        if value is None:
            return {"": None, "_lower": None, "_upper": None}
        return {"": value.value, "_lower": value.lower, "_upper": value.upper}


MEASURE = _AsMeasured()


def rows_table(rows: Mapping[str, Measure | Plain]) -> Table:
    """Return names and values as a table."""
    cells = [
        (name, Cell(value, MEASURE if isinstance(value, Measure) else TEXT)) for name, value in rows.items()
    ]
    return Table("", ("Name", "Value"), cells)


def measures_of(sections: Mapping[str, Mapping[str, Measure | Plain]]) -> dict[str, Measure]:
    """Return the measures of the sections of a report by their keys."""
    values = (value for rows in sections.values() for value in rows.values())
    return {value.key: value for value in values if isinstance(value, Measure)}


@dataclass(frozen=True)
class Measured:
    """A quantity of a section, declared once."""

    key: str
    """Name in gates."""
    title: str
    """Name of its row."""
    unit: str
    """One of :data:`UNITS`."""
    probe: str = ""
    """Probe that it needs; empty for none."""
    line: str = ""
    """Title of its line in the terminal, at most 31 characters; empty for no line there."""
    of_change: bool = False
    """True for what the event changed, which needs pairs that can show it (see
    :mod:`pytest_libero_max.report.measurable`)."""

    def row(self, value: float | None, interval: Interval | None = None, **more: Any) -> Rows:
        if interval is not None:
            more |= {"lower": number(interval.lower), "upper": number(interval.upper)}
        return {self.title: Measure(key=self.key, unit=self.unit, value=number(value), **more)}

    def ratio(self, block: Ratio | Rate | MeanDifference) -> Rows:
        """Return the row of a share, or of a change, which is printed without its counts."""
        more: dict[str, Any] = (
            {} if isinstance(block, Ratio) else {"lower": block.lower, "upper": block.upper}
        )
        if self.unit != "change":
            more |= {"count": block.count, "of": block.of}
        return {self.title: Measure(key=self.key, unit=self.unit, value=block.value, **more)}

    def share(self, ends: Iterable[bool], *, with_interval: bool = True) -> Rows:
        """Return the row of a share of pairs, with its exact interval."""
        values = [*ends]
        return self.ratio(rate_of(ratios.Ratio(sum(values), len(values)), with_interval=with_interval))

    def change(self, base: Sequence[bool], dynamic: Sequence[bool], *, with_interval: bool = True) -> Rows:
        """Return the row of the second share of the same pairs less the first, with its exact interval."""
        return self.ratio(table_change_of(tabulate(base, dynamic), with_interval=with_interval))

    def median(self, values: Sequence[float | None], *, with_interval: bool = True) -> Rows:
        """Return the row of the median of the values that exist, with the number of these."""
        known = [value for value in values if value is not None]
        interval = median_interval(known) if with_interval and known else None
        middle = median(known) if known else None
        return self.row(middle, interval, count=len(known), of=len(values))


def in_both_arms(key: str, title: str, unit: str, probe: str = "") -> tuple[Measured, Measured]:
    """Return a quantity of Base and of Dynamic."""
    return (
        Measured(f"{key}.base", f"{title}, Base", unit, probe),
        Measured(f"{key}.dynamic", f"{title}, Dynamic", unit, probe),
    )
