"""Docstrings taken apart: Google style, as the whole package writes it."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from types import ModuleType

_SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields):$", re.M)
_ENTRY = re.compile(r"^(?P<name>\w+): (?P<text>.*(?:\n(?: .*)?)*)", re.M)


@dataclass(frozen=True)
class Documented:
    """A name of a module and what is said of it.

    Attributes:
        name: The name.
        value: How the source spells its value.
        text: Its docstring; empty where there is none.
    """

    name: str
    value: str
    text: str


def description(thing: object) -> str:
    """The docstring without its sections, such as ``Attributes:``."""
    return _SECTION.split(inspect.getdoc(thing) or "", maxsplit=1)[0].strip()


def summary(thing: object) -> str:
    """The docstring's first paragraph on one line."""
    return " ".join(description(thing).split("\n\n", maxsplit=1)[0].split())


def section(thing: object, name: str) -> dict[str, str]:
    """The entries of a docstring's section by name, each on one line.

    Args:
        thing: What has the docstring.
        name: ``Args``, ``Attributes`` or ``Raises``. The attributes of a class may also have their docstrings
            under them.
    """
    under = _under_fields(thing) if inspect.isclass(thing) and name == "Attributes" else {}
    pieces = _SECTION.split(inspect.getdoc(thing) or "")
    bodies = dict(zip(pieces[1::2], pieces[2::2], strict=True))
    body = textwrap.dedent(bodies.get(name, "").strip("\n"))
    return {match["name"]: " ".join(match["text"].split()) for match in _ENTRY.finditer(body)} | under


def _under_fields(cls: type) -> dict[str, str]:
    """The docstrings of the fields of a class, each on one line."""
    try:
        (statement,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    except (OSError, TypeError):  # made at run time
        return {}
    assert isinstance(statement, ast.ClassDef)
    return {
        target: " ".join(str(following.value.value).split())
        for field, following in pairwise(statement.body)
        if (target := _target(field)) is not None
        and isinstance(following, ast.Expr)
        and isinstance(following.value, ast.Constant)
    }


def constants(module: ModuleType) -> Iterator[Documented]:
    """The public constants of a module that have a docstring, in the order of the source."""
    source = inspect.getsource(module)
    statements = ast.parse(source).body
    for statement, following in pairwise(statements):
        target = _target(statement)
        if target is None or not target.isupper() or target.startswith("_"):
            continue
        if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
            value = getattr(statement, "value", None)
            spelled = ast.get_source_segment(source, value) if value is not None else None
            yield Documented(target, " ".join((spelled or "").split()), str(following.value.value).strip())


def _target(statement: ast.stmt) -> str | None:
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
        return statement.target.id
    if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
        return statement.targets[0].id
    return None
