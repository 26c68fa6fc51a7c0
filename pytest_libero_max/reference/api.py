"""The page of the Python API: public names, their signatures and what they are for."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType

from pytest_libero_max.reference import COMMAND, PAGES
from pytest_libero_max.reference.docstrings import public_names, summary
from pytest_libero_max.reference.markdown import code, one_line, table

MODULES: Mapping[str, str] = {
    "pytest_libero_max": "What an adapter imports.",
    "pytest_libero_max.policies.contract": "What a policy is.",
    "pytest_libero_max.policies.check": "Checks of a policy, which the pair runner makes as well.",
    "pytest_libero_max.policies.loading": "From the text of `--libero-max-policy` to a policy.",
    "pytest_libero_max.benchmark.cases": "Cases and their events.",
    "pytest_libero_max.benchmark.manifests": "Manifests: files of cases.",
    "pytest_libero_max.benchmark.tracks": "The tracks that are installed with the package.",
    "pytest_libero_max.benchmark.sampling": "Smaller sets of cases.",
    "pytest_libero_max.worlds.contract": "What a world and a substrate are.",
    "pytest_libero_max.worlds.registry": "The substrates by name.",
    "pytest_libero_max.changes": "Changes of a world.",
    "pytest_libero_max.pairing.runner": "Playing a pair, or a part of it, without pytest.",
    "pytest_libero_max.pairing.record": "What is kept of a pair.",
    "pytest_libero_max.report.build": "From records to the report.",
    "pytest_libero_max.report.store": "Reading and writing `pairs.jsonl`.",
    "pytest_libero_max.report.gates": "Conditions on a report.",
    "pytest_libero_max.strategies": "Hypothesis strategies.",
    "pytest_libero_max.errors": "Every exception that the package raises.",
}
"""The modules with public names, in the order of the page, and what each is for."""


def page() -> str:
    """The text."""
    pages = table(
        ("Page", "Written by"),
        ((f"[{name}](../{name})", code(f"reference/{module}.py")) for name, module in PAGES.items()),
    )
    modules = "\n\n".join(_module(import_module(name), text) for name, text in MODULES.items())
    return f"""# Reference

`{COMMAND}` writes these pages from the code. A test fails when one of them is not what the code says.

{pages}

# The Python API

The names below are public: they change only with a line in the [changelog](../../CHANGELOG.md). Every other name is
internal.

{modules}
"""


def _module(module: ModuleType, text: str) -> str:
    rows = []
    for name in public_names(module):
        value = getattr(module, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            rows.append((code(name + _signature(value)), one_line(summary(value))))
    return f"## `{module.__name__}`\n\n{text}\n\n{table(('Name', 'Meaning'), rows)}"


def _signature(value: object) -> str:
    """Parameter names and defaults; nothing for an exception or a protocol."""
    if inspect.isclass(value) and (issubclass(value, BaseException) or getattr(value, "_is_protocol", False)):
        return ""
    parameters = [
        parameter.replace(annotation=inspect.Parameter.empty)
        for name, parameter in inspect.signature(value).parameters.items()  # type: ignore[arg-type]
        if name != "self"
    ]
    return str(inspect.Signature(parameters))
