"""The page of reports: every field of ``report.json`` and of a comparison."""

from __future__ import annotations

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.report_document import Report
from tests.reference.markdown import code, one_line, table
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
    return f"""# Fields of reports and comparisons

## Fields of `report.json`

Computed from `pairs.jsonl` alone. The schema is
[`report.schema.json`](../../pytest_libero_max/report/report.schema.json). `*` stands for any key and `[]` for
the items of a list. A type that is not JSON's own is a definition below.

{_fields(schema)}

## Fields of a comparison

`libero-max compare --json FILE` writes them. The schema:
[`comparison.schema.json`](../../pytest_libero_max/report/comparison.schema.json).

{_fields(comparison)}

## Definitions

{definitions}
"""


def _defined(schema: Json) -> dict[str, Json]:
    """The schema that holds each definition."""
    return dict.fromkeys(schema["$defs"], schema)


def _definition(schema: Json, name: str) -> str:
    node = schema["$defs"][name]
    text = node.get("description", "")
    return f"{text}\n\n{_fields(schema, name) if 'properties' in node else kind_of(node)}".strip()


def _fields(schema: Json, definition: str | None = None) -> str:
    rows = ((code(path), kind, one_line(text)) for path, kind, text in fields_of(schema, definition))
    return table(("Field", "Type", "Meaning"), rows)
