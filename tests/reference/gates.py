"""The page of gates: their language, and every quantity that one can ask for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.lab.sections import audit, monitors
from pytest_libero_max.report import gate_quantities, gates
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.quantities import QUANTITIES
from tests.reference.docstrings import description
from tests.reference.markdown import code, prose, table
from tests.reference.report import comparison_schema, report_schema


def page() -> str:
    """The text."""
    schema, comparison = report_schema(), comparison_schema()
    return f"""# Gates

{prose(description(gates))}

## Quantities of the whole run or of a group

{_quantities()}

## Counts of pairs

These can be decided in an incomplete run. `invalid` and `missing` are of the whole run only.

{_counts(schema)}

## Numbers of sections

These are of the whole run. Each has the ends of its interval, where it has one, as `.lower` and `.upper`.
Those of a monitor are called `monitor.NAME.KEY`, with the keys
{", ".join(code(key) for key in monitors.ROWS)};
those of an arm of the study `audit` are called `audit.ARM.KEY`, with the keys
{", ".join(code(key) for key in audit.QUANTITIES)}.
A column of any probe is `PROBE.COLUMN`, its mean over the pairs in Dynamic, or `PROBE.COLUMN.ARM`; with
`.largest` it is the largest value of a pair.

{_measured()}

## Against another run

For example `dynamic_sr_vs(reports/v1).lower >= -5%`, or the condition `equivalent_vs(reports/v1, 5%)`. The
other run is the first of the comparison, the present run the second.

{_versus(comparison)}

## Scopes

{_scopes()}
"""


def _counts(schema: Json) -> str:
    described = schema["$defs"]["PairCounts"]["properties"]
    return table(
        ("Quantity", "Meaning"),
        ((code(name), described[name]["description"]) for name in gate_quantities.COUNTS),
    )


def _measured() -> str:
    rows = (
        (code(one.key), one.title.removeprefix("... "), one.unit)
        for one in gate_quantities.section_quantities().values()
    )
    return table(("Quantity", "Meaning", "Unit"), rows)


def _versus(comparison: Json) -> str:
    described = comparison["$defs"]["SuccessContrast"]["properties"]
    rows = (
        (code(f"{name}(RUN)"), described[_place(value)]["description"])
        for name, (value, _) in gates.VERSUS.items()
    )
    return table(("Quantity", "Meaning"), rows)


class _Recorder:
    """Takes the place of a block, and remembers the attributes that are asked of it."""

    def __init__(self, path: tuple[str, ...] = ()) -> None:
        self._path = path

    def __getattr__(self, name: str) -> _Recorder:
        return _Recorder((*self._path, name))

    def __str__(self) -> str:
        return ".".join(self._path)


def _place(value: Callable[[Any], object]) -> str:
    """The attributes that a column reads, joined by dots."""
    return str(value(_Recorder()))


def _quantities() -> str:
    rows = [
        (
            code(column.gate or column.key),
            column.title,
            "yes" if column.format.has_interval else "",
            code(_place(column.value)),
        )
        for column in QUANTITIES
        if column.gate is not None
    ]
    return table(("Quantity", "Meaning", "Interval", "Place in a row of the report"), rows)


def _scopes() -> str:
    return table(("Dimension", "Groups"), ((code(name), item.title) for name, item in DIMENSIONS.items()))
