"""The page of the Python API: the public names, which MkDocs describes by their docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from types import ModuleType

import pytest_libero_max
from pytest_libero_max.registry import ENTRY_POINTS
from tests.reference.docstrings import summary
from tests.reference.markdown import code, table

ADAPTER = ("PolicySpec", "Policy", "Episode", "Query")
"""Names that an adapter needs, which come first."""

IN_TRAINING = ("lab.training.PairedEval", "lab.training.Evaluated")


def page() -> str:
    """The text."""
    groups = table(("Group", "An entry is"), ((code(group), text) for group, text in ENTRY_POINTS.items()))
    used = [name for names in pytest_libero_max._TO_USE.values() for name in names if name not in ADAPTER]
    extended = [name for names in pytest_libero_max._TO_EXTEND.values() for name in names]
    public = (getattr(pytest_libero_max, name) for name in pytest_libero_max.__all__)
    modules = "\n\n".join(_module(value) for value in public if inspect.ismodule(value))
    return f"""# The Python API

The names on this page are public: they change only with a line in the [changelog](../../CHANGELOG.md). Every
other name, and every other module, is internal and may move. Nothing heavy is imported before a name is used.
`pytest_libero_max.gym`, which needs the extra `gym`, is public too
([your own loop](../how-to/own-loop.md)), and of the lab what a [training](../how-to/training.md) needs.

## For an adapter

{_entries(ADAPTER)}

## To play and read pairs

{_entries(used)}

## During a training

{_entries(IN_TRAINING)}

## To extend

{_entries(extended)}

{modules}

## Entry points

Another package adds these without a change of this one. This [example](../../tests/plugin/example_package)
adds an event, a change, a trigger, a probe, a section of the report, a stopping rule, a study, a protocol, a
command and a format.

{groups}
"""


def _entries(names: Iterable[str]) -> str:
    return "\n\n".join(f"::: pytest_libero_max.{name}" for name in names)


def _module(module: ModuleType) -> str:
    """The section of a public module: the functions and classes of its ``__all__``."""
    own = ((name, getattr(module, name)) for name in module.__all__ if name not in pytest_libero_max.__all__)
    names = [name for name, value in own if inspect.isfunction(value) or _is_own(value)]
    entries = "\n\n".join(f"::: {module.__name__}.{name}" for name in names)
    return f"## `{module.__name__}`\n\n{summary(module)}\n\n{entries}"


def _is_own(value: object) -> bool:
    return inspect.isclass(value) and value.__module__.startswith("pytest_libero_max.")
