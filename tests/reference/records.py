"""The page of the pair runner: what ``pairs.jsonl`` holds."""

from __future__ import annotations

from typing import Any

from pytest_libero_max import pairing
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import RECORD_VERSION, ArmRecord, FiringRecord, PairError, PairRecord
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.stopped import Stopped
from tests.reference.docstrings import description
from tests.reference.markdown import code, one_line, prose, table
from tests.reference.schemas import fields_of, schema_of


def schema() -> Json:
    """The JSON Schema of the lines of ``pairs.jsonl``."""
    text = (
        "The first line is the run; every other line is a measured pair, a pair that could not be measured, "
        "or why the run was stopped."
    )
    return schema_of(Run | PairRecord | PairError | Stopped, "A line of pairs.jsonl", text)


def page() -> str:
    """The text."""
    lines = schema()
    first = _table(lines, "Run")
    tables = "\n\n".join(
        _class(lines, cls) for cls in (PairRecord, ArmRecord, FiringRecord, PairError, PlannedPair, Stopped)
    )
    return f"""# Pair records

{prose(description(pairing))}

`pairs.jsonl` holds one JSON object a line. The first line, `"line": "run"`, is the run: `provenance` and the
`planned` pairs (`PlannedPair`). Every other line is a measured pair (`"line": "pair"`, the fields of
`PairRecord`) or a pair that could not be measured (`"line": "error"`, the fields of `PairError`). A run that
was stopped ends with the reason (`"line": "stopped"`, the fields of `Stopped`). The schema is
[`record.schema.json`](../../pytest_libero_max/report/record.schema.json). The schema version is
{RECORD_VERSION}; files of another one are refused.

{tables}

## The first line

{first}
"""


def _class(lines: Json, cls: type[Any]) -> str:
    return f"## {cls.__name__}\n\n{prose(description(cls))}\n\n{_table(lines, cls.__name__)}"


def _table(lines: Json, name: str) -> str:
    rows = ((code(path), kind, one_line(text)) for path, kind, text in fields_of(lines, name))
    return table(("Field", "Type", "Meaning"), rows)
