"""The page of reports: every field of ``report.json``, and every quantity a gate can ask for."""

from __future__ import annotations

import json
from importlib.resources import files

from pytest_libero_max import report
from pytest_libero_max.reference.docstrings import description
from pytest_libero_max.reference.markdown import code, one_line, prose, table
from pytest_libero_max.reference.schemas import fields_of
from pytest_libero_max.report import gates


def page() -> str:
    """The text."""
    schema = json.loads(files(report).joinpath("report.schema.json").read_text(encoding="utf-8"))
    definitions = "\n\n".join(
        f"### {name}\n\n{_definition(schema, name)}" for name in sorted(schema["$defs"])
    )
    return f"""# Reports and gates

{prose(description(report))}

## Gates

{prose(description(gates))}

## Fields of `report.json`

Computed from `pairs.jsonl` alone. The schema is [`report.schema.json`](report.schema.json). `*` stands for any key and
`[]` for the items of a list. A type that is not JSON's own is a definition below.

{_fields(schema)}

## Definitions

{definitions}
"""


def _definition(schema: dict[str, dict[str, dict[str, str]]], name: str) -> str:
    text = schema["$defs"][name].get("description", "")
    return f"{text}\n\n{_fields(schema, name)}".strip()


def _fields(schema: dict[str, dict[str, dict[str, str]]], definition: str | None = None) -> str:
    rows = ((code(path), kind, one_line(text)) for path, kind, text in fields_of(schema, definition))
    return table(("Field", "Type", "Meaning"), rows)
