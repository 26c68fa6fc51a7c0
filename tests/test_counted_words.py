"""Numbers before nouns in what users read: 1 pair, 2 pairs, and never ``pair(s)``."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import pytest_libero_max
from pytest_libero_max.errors import counted

PACKAGE = Path(pytest_libero_max.__file__).parent

NOUNS = "pairs|cases|runs|steps|queries|actions|servers|workers|tasks|episodes|shards|labels|columns"

_COUNTED = re.compile(rf" (?:{NOUNS})\b(?!/)")
"""A noun right behind a number."""

OF_MANY = {
    "case.budget",  # a suite has hundreds
    "count",  # of what is there twice, or of a chunk that is longer than H
    "asked",  # a list
    "pairs",  # several, after which a run is stopped
    "_either(stale)",  # words
    "', '.join(map(str, lengths))",  # several
    "steps",  # beyond the most
    "number",  # three or more
    "shards",  # two or more
    "file.cases",  # of a released manifest
    "done.steps",  # of all arms of a study
    "done.queries",
    "times.total()",  # of all pairs
    "-(-fleet.workers // most)",  # two or more
    "len(first)",
    "len(onward)",
}
"""Expressions that are never 1, or no number, apart from constants."""


def test_a_number_agrees_with_its_noun() -> None:
    assert [counted(number, "pair") for number in (0, 1, 2)] == ["0 pairs", "1 pair", "2 pairs"]
    assert counted(1, "query", "queries") == "1 query"
    assert [counted(number, "GPU") for number in (0.25, 1.0)] == ["0.25 GPUs", "1 GPU"]


def _files(*endings: str) -> list[Path]:
    return sorted(path for path in PACKAGE.rglob("*") if path.suffix in endings)


def _texts(file: Path) -> Iterator[tuple[int, str]]:
    """The texts of a module, but for docstrings, with their lines."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    bare = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare:
            yield node.lineno, node.value


def test_no_text_leaves_the_plural_open() -> None:
    opened = [
        f"{path}:{line}: {text}" for path in _files(".py") for line, text in _texts(path) if "(s)" in text
    ]
    opened += [str(path) for path in _files(".html", ".toml") if "(s)" in path.read_text(encoding="utf-8")]
    assert not opened


@pytest.mark.parametrize("room", sorted({path.relative_to(PACKAGE).parts[0] for path in _files(".py")}))
def test_numbers_that_may_be_1_are_counted(room: str) -> None:
    if room == "makers":
        pytest.skip("its sentences are of the makers' own machines")
    plural = []
    for path in _files(".py"):
        if path.relative_to(PACKAGE).parts[0] != room:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.JoinedStr):
                continue
            for number, rest in zip(node.values, node.values[1:], strict=False):
                if not (isinstance(number, ast.FormattedValue) and isinstance(rest, ast.Constant)):
                    continue
                expression, text = ast.unparse(number.value), str(rest.value)
                if _COUNTED.match(text) and expression not in OF_MANY and not expression.isupper():
                    plural.append(f"{path.name}:{number.lineno}: {{{expression}}}{text}")
    assert not plural
