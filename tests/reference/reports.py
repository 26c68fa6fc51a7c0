"""The page of reports: every field of ``report.json``, and every quantity a gate can ask for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pytest_libero_max import report
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.lab.sections import audit, monitors
from pytest_libero_max.report import diagnosis, gate_quantities, gates
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.quantities import QUANTITIES
from pytest_libero_max.report.report_document import Report
from tests.reference.docstrings import description
from tests.reference.markdown import code, one_line, prose, table
from tests.reference.schemas import fields_of, kind_of, written_schema


def report_schema() -> Json:
    """The JSON Schema of ``report.json``."""
    return written_schema(Report)


def comparison_schema() -> Json:
    """The JSON Schema of a comparison."""
    return written_schema(Comparison)


def page() -> str:
    """The text."""
    schema, comparison = report_schema(), comparison_schema()
    definitions = "\n\n".join(
        f"### {name}\n\n{_definition(found, name)}"
        for name, found in sorted({**_defined(comparison), **_defined(schema)}.items())
    )
    return f"""# Reports and gates

{prose(description(report))}

## Gates

{prose(description(gates))}

### Quantities of the whole run or of a group

{_quantities()}

### Counts of pairs

These can be decided in an incomplete run. `invalid` and `missing` are of the whole run only.

{_counts(schema)}

### Numbers of sections

These are of the whole run. Each has the ends of its interval, where it has one, as `.lower` and `.upper`.
Those of a monitor are called `monitor.NAME.KEY`, with the keys
{", ".join(code(key) for key in monitors.ROWS)};
those of an arm of the study `audit` are called `audit.ARM.KEY`, with the keys
{", ".join(code(key) for key in audit.QUANTITIES)}.
A column of any probe is `PROBE.COLUMN`, its mean over the pairs in Dynamic, or `PROBE.COLUMN.ARM`; with
`.largest` it is the largest value of a pair.

{_measured()}

### Against another run

For example `dynamic_sr_vs(reports/v1).lower >= -5%`, or the condition `equivalent_vs(reports/v1, 5%)`. The
other run is the first of the comparison, the present run the second.

{_versus(comparison)}

### Scopes

{_scopes()}

## Causes

{prose(description(diagnosis))}

{table(("Cause", "Meaning"), ((code(name), meaning) for name, meaning in diagnosis.CAUSES.items()))}

## Fields of `report.json`

Computed from `pairs.jsonl` alone. The schema is [`report.schema.json`](report.schema.json). `*` stands for
any key and `[]` for the items of a list. A type that is not JSON's own is a definition below.

{_fields(schema)}

## Fields of a comparison

`libero-max compare --json FILE` writes them. The schema:
[`comparison.schema.json`](comparison.schema.json).

{_fields(comparison)}

## Definitions

{definitions}
"""


def _defined(schema: Json) -> dict[str, Json]:
    """The schema that holds each definition."""
    return dict.fromkeys(schema["$defs"], schema)


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


def _definition(schema: Json, name: str) -> str:
    node = schema["$defs"][name]
    text = node.get("description", "")
    return f"{text}\n\n{_fields(schema, name) if 'properties' in node else kind_of(node)}".strip()


def _fields(schema: Json, definition: str | None = None) -> str:
    rows = ((code(path), kind, one_line(text)) for path, kind, text in fields_of(schema, definition))
    return table(("Field", "Type", "Meaning"), rows)
