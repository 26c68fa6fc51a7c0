"""The reference pages and JSON Schemas, written from the code's own docstrings, structs and tables.

``python -m tests.reference`` writes every page into the folder it is about. A page is one module
here, with a function ``page`` that returns its text; :data:`PAGES` says where it goes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

import pytest_libero_max

PACKAGE = Path(pytest_libero_max.__file__).parent

COMMAND = "python -m tests.reference"

PAGES: Mapping[str, str] = {
    "API.md": "api",
    "cli/README.md": "commands",
    "events/README.md": "events",
    "pairing/README.md": "records",
    "pairing/probes/README.md": "probes",
    "plugin/README.md": "options",
    "report/README.md": "reports",
    "worlds/README.md": "worlds",
}
"""Path of each page inside the package, and the module here that writes it."""

SCHEMAS: Mapping[str, tuple[str, str]] = {
    "report/record.schema.json": ("records", "schema"),
    "report/report.schema.json": ("reports", "report_schema"),
    "report/comparison.schema.json": ("reports", "comparison_schema"),
}
"""Path of each JSON Schema inside the package, and the module and function here that return it."""


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
    return json.dumps(getattr(import_module(f"{__name__}.{module}"), function)(), indent=1) + "\n"


def file_text(path: str) -> str:
    """The text of a page or a schema.

    Args:
        path: A key of :data:`PAGES` or of :data:`SCHEMAS`.
    """
    return page_text(path) if path in PAGES else schema_text(path)


def write_pages(folder: Path = PACKAGE) -> list[Path]:
    """Write every page and schema below ``folder`` and return the paths of those that changed."""
    changed = []
    for name in (*PAGES, *SCHEMAS):
        path, text = folder / name, file_text(name)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    return changed
