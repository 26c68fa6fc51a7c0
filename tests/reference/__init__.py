"""The reference pages and JSON Schemas, written from the code's own docstrings, structs and tables.

``python -m tests.reference`` writes the pages into ``docs/reference`` and the schemas into the package. A
page is one module here, with a function ``page`` that returns its text; :data:`PAGES` says where it goes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest_libero_max
from tests.reference.excerpts import with_excerpts

PACKAGE = Path(pytest_libero_max.__file__).parent
ROOT = PACKAGE.parent

COMMAND = "python -m tests.reference"

WIDTH = 130
"""Characters of a line of a schema."""

PAGES: Mapping[str, str] = {
    f"docs/reference/{name}.md": name
    for name in (
        "api",
        "causes",
        "commands",
        "events",
        "gates",
        "glossary",
        "index",
        "options",
        "probes",
        "records",
        "report",
        "rules",
        "worlds",
    )
}
"""Path of each page in the repository, and the module here that writes it."""

EXCERPTS = ("README.md", "docs/tutorial.md")
"""Pages written by hand that show the output of a published run."""

SCHEMAS: Mapping[str, tuple[str, str]] = {
    "pytest_libero_max/report/record.schema.json": ("records", "schema"),
    "pytest_libero_max/report/report.schema.json": ("report", "report_schema"),
    "pytest_libero_max/report/comparison.schema.json": ("report", "comparison_schema"),
    "pytest_libero_max/conformance/conformance.schema.json": ("rules", "schema"),
}
"""Path of each JSON Schema in the repository, and the module and function here that return it."""


def page_text(path: str) -> str:
    """The text of a page, with the note that it is generated.

    Args:
        path: A key of :data:`PAGES`.
    """
    page: Callable[[], str] = import_module(f"{__name__}.{PAGES[path]}").page
    note = f"<!-- Written by `{COMMAND}` from the code. Change the code, not this page. -->"
    return f"{note}\n\n{page().strip()}\n"


def schema_text(path: str) -> str:
    """The text of a JSON Schema.

    Args:
        path: A key of :data:`SCHEMAS`.
    """
    module, function = SCHEMAS[path]
    return _json_lines(getattr(import_module(f"{__name__}.{module}"), function)()) + "\n"


def _json_lines(value: Any, indent: str = "") -> str:
    """JSON with every object and list that fits in a line on one line."""
    whole = json.dumps(value)
    if not isinstance(value, dict | list) or not value or len(indent) + len(whole) <= WIDTH:
        return whole
    inner = indent + " "
    if isinstance(value, dict):
        parts = [f"{json.dumps(key)}: {_json_lines(part, inner)}" for key, part in value.items()]
    else:
        parts = [_json_lines(part, inner) for part in value]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n{inner}" + f",\n{inner}".join(parts) + f"\n{indent}{closing}"


def file_text(path: str) -> str:
    """The text of a page, a schema, or a page with outputs.

    Args:
        path: A key of :data:`PAGES` or of :data:`SCHEMAS`, or one of :data:`EXCERPTS`.
    """
    if path in EXCERPTS:
        return with_excerpts((ROOT / path).read_text(encoding="utf-8"), ROOT)
    return page_text(path) if path in PAGES else schema_text(path)


def write_pages(folder: Path = ROOT) -> list[Path]:
    """Write every page and schema below ``folder`` and return the paths of those that changed."""
    changed = []
    for name in (*PAGES, *SCHEMAS, *EXCERPTS):
        path, text = folder / name, file_text(name)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    return changed
