"""The page of the pair runner: what ``pairs.jsonl`` holds."""

from __future__ import annotations

import inspect
import json
from importlib.resources import files

from msgspec import Struct

from pytest_libero_max import pairing, report
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing import record
from tests.reference.docstrings import description, section
from tests.reference.markdown import code, one_line, prose, table
from tests.reference.schemas import fields_of


def page() -> str:
    """The text."""
    classes = [
        value
        for value in vars(record).values()
        if inspect.isclass(value) and issubclass(value, Struct) and value.__module__ == record.__name__
    ]
    order = {name: position for position, name in enumerate(("PairRecord", "ArmRecord", "FiringRecord"))}
    classes.sort(key=lambda cls: order.get(cls.__name__, len(order)))
    schema: Json = json.loads(files(report).joinpath("record.schema.json").read_text(encoding="utf-8"))
    first = table(
        ("Field", "Type", "Meaning"),
        ((code(path), kind, one_line(text)) for path, kind, text in fields_of(schema, "run")),
    )
    tables = "\n\n".join(map(_class, classes))
    return f"""# Pair records

{prose(description(pairing))}

`pairs.jsonl` holds one JSON object a line. The first line, `"line": "run"`, is the run: `provenance` and the
`planned` pairs. Every other line is a measured pair (`"line": "pair"`, the fields of `PairRecord`) or a pair
that could not be measured (`"line": "error"`, the fields of `PairError`). The schema is
[`record.schema.json`](../report/record.schema.json). The schema version is {record.RECORD_VERSION}.

{tables}

## The first line

{first}
"""


def _class(cls: type[Struct]) -> str:
    texts, types = section(cls, "Attributes"), cls.__annotations__
    rows = (
        (code(name), code(types[name]), one_line(texts.get(name, _common(name))))
        for name in cls.__struct_fields__
    )
    return f"## {cls.__name__}\n\n{prose(description(cls))}\n\n{table(('Field', 'Type', 'Meaning'), rows)}"


def _common(name: str) -> str:
    """Text of a field that another class of the module documents."""
    if name == "schema_version":
        return f"Version of the form of the record: {record.RECORD_VERSION}."
    return section(record.PairRecord, "Attributes").get(name, "")
