"""The page of the Python API: the names of the façade, their signatures and what they are for."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import fields
from types import ModuleType
from typing import Any

import pytest_libero_max
from pytest_libero_max.registry import ENTRY_POINTS
from tests.reference import COMMAND, PAGES
from tests.reference.docstrings import description, section, summary
from tests.reference.markdown import code, one_line, prose, table

ADAPTER = ("PolicySpec", "Policy", "Episode", "Query")
"""Names that an adapter needs; these are described at length."""


def page() -> str:
    """The text."""
    pages = table(
        ("Page", "Written by"),
        (
            (f"[{name}]({name})", f"[`{module}.py`](../tests/reference/{module}.py)")
            for name, module in PAGES.items()
        ),
    )
    groups = table(("Group", "An entry is"), ((code(group), text) for group, text in ENTRY_POINTS.items()))
    adapter = "\n\n".join(_class(getattr(pytest_libero_max, name)) for name in ADAPTER)
    public = {name: getattr(pytest_libero_max, name) for name in pytest_libero_max.__all__}
    namespaces = [value for value in public.values() if inspect.ismodule(value)]
    modules = "\n\n".join(_module(module) for module in namespaces)
    used = [name for names in pytest_libero_max._TO_USE.values() for name in names if name not in ADAPTER]
    extended = [name for names in pytest_libero_max._TO_EXTEND.values() for name in names]
    return f"""# Reference

`{COMMAND}` writes these pages from the code. A test fails when one of them is not what the code says.

{pages}

## Entry points

Another package adds these without a change of this one. This [example](../tests/plugin/example_package) adds
an event, a change, a trigger, a probe, a section of the report, a stopping rule, a study, a protocol, a
command and a format.

{groups}

# The Python API

The names on this page are public: they change only with a line in the [changelog](../CHANGELOG.md). Every
other name, and every other module, is internal and may move.

## `pytest_libero_max`

Nothing heavy is imported before a name is used. `pytest_libero_max.gym`, which needs the extra `gym`, is
public too and [described apart](../fixtures/runners/README.md). For adapters, and for playing and reading
pairs in Python:

{_table((name, public[name]) for name in used)}

For packages that add events, changes, triggers, probes, sections, studies, stopping rules, substrates or
protocols:

{_table((name, public[name]) for name in extended)}

{adapter}

{modules}
"""


def _class(cls: type[Any]) -> str:
    texts = section(cls, "Attributes")
    rows = [
        (code(item.name), code(item.type), one_line(texts.get(item.name, "")))
        for item in (fields(cls) if hasattr(cls, "__dataclass_fields__") else ())
    ]
    methods = [
        (code(name + _signature(value)), one_line(summary(value)))
        for name, value in vars(cls).items()
        if inspect.isfunction(value) and not name.startswith("_") and inspect.getdoc(value)
    ]
    tables = [table(("Field", "Type", "Meaning"), rows)] if rows else []
    tables += [table(("Method", "Meaning"), methods)] if methods else []
    return "\n\n".join([f"### {cls.__name__}", prose(description(cls)), *tables])


def _module(module: ModuleType) -> str:
    """The section of a public module: the functions and classes of its ``__all__``."""
    found = (
        (name, getattr(module, name)) for name in module.__all__ if name not in pytest_libero_max.__all__
    )
    rows = _table((name, value) for name, value in found if inspect.isfunction(value) or _is_own(value))
    return f"## `{module.__name__}`\n\n{summary(module)}\n\n{rows}"


def _is_own(value: object) -> bool:
    return inspect.isclass(value) and value.__module__.startswith("pytest_libero_max.")


def _table(found: Iterable[tuple[str, Any]]) -> str:
    rows = ((code(name + _signature(value)), one_line(summary(value))) for name, value in found)
    return table(("Name", "Meaning"), rows)


def _signature(value: Any) -> str:
    """Of a function; nothing for a class, whose fields or methods are described elsewhere."""
    if inspect.isclass(value):
        return ""
    signature = inspect.signature(value)
    parameters = [_parameter(item) for item in signature.parameters.values() if item.name != "self"]
    keyword_only = [item.kind is item.KEYWORD_ONLY for item in signature.parameters.values()]
    if any(keyword_only):
        parameters.insert(keyword_only.index(True), "*")
    returns = "" if signature.return_annotation == inspect.Signature.empty else signature.return_annotation
    return f"({', '.join(parameters)})" + (f" -> {returns}" if returns else "")


def _parameter(parameter: inspect.Parameter) -> str:
    text = f"{parameter.name}: {parameter.annotation}"
    if parameter.default is inspect.Parameter.empty:
        return text
    plain = parameter.default is None or isinstance(parameter.default, bool | int | float | str)
    return f"{text} = {parameter.default!r}" if plain else f"{text} = ..."
