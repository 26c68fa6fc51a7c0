"""The page of the rules of conformance, and the schema of their results."""

from __future__ import annotations

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.conformance.registry import RULES, rules_for
from pytest_libero_max.conformance.results import Conformance
from pytest_libero_max.conformance.subjects import KINDS
from tests.reference.markdown import code, table
from tests.reference.schemas import fields_of, written_schema

NAMES = {"env": "an environment"}


def schema() -> Json:
    """The JSON Schema of ``conformance.json``."""
    return written_schema(Conformance)


def page() -> str:
    """The text."""
    kinds = "\n\n".join(f"## Of {NAMES.get(kind, f'a {kind}')}\n\n{_table(kind)}" for kind in KINDS)
    document = schema()
    parts = "\n\n".join(
        f"### {name}\n\n{_fields(name)}"
        for name in document["$defs"]
        if "properties" in document["$defs"][name]
    )
    return f"""# Rules of conformance

`pytest --libero-max-conform=SUBJECT` makes a test of each rule ([how to](../how-to/conformance.md)). `must`
decides the exit status; `should` and `note` are shown. A rule of your own is an object in the entry-point
group `{RULES.group}`.

{kinds}

## Fields of `conformance.json`

The schema is [`conformance.schema.json`](../../pytest_libero_max/conformance/conformance.schema.json).

{_fields()}

{parts}
"""


def _table(kind: str) -> str:
    rows = ((code(rule.id.partition("/")[2]), rule.level, rule.title) for rule in rules_for(kind))
    return table(("Rule", "Level", "What it asks"), rows)


def _fields(definition: str | None = None) -> str:
    rows = ((code(path), kind, text) for path, kind, text in fields_of(schema(), definition))
    return table(("Field", "Type", "Meaning"), rows)
