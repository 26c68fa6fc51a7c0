from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.benchmark.source_digest import code_digest

CODE = """
import math

LIMIT = 3


def way(x: float) -> float:
    return math.sqrt(x) + LIMIT
"""

SAME = '''
"""A module."""

import math  # for the root

LIMIT = (
    3
)
"""How far."""


def way(x: float) -> float:
    """The way."""
    # that is all
    return math.sqrt( x ) + LIMIT
'''


def digest(folder: Path, *texts: str | bytes, name: str = "code.py") -> str:
    paths = []
    for number, text in enumerate(texts):
        path = folder / str(number) / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        paths.append(path)
    return code_digest(paths)


def test_comments_docstrings_and_layout_do_not_count(tmp_path: Path) -> None:
    assert digest(tmp_path, CODE) == digest(tmp_path, SAME)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("LIMIT = 3", "LIMIT = 4"),
        ("LIMIT = 3", "LIMIT = 3.0"),
        ("LIMIT = 3", "LIMIT = '3'"),
        ("LIMIT = 3", "LIMIT = -3"),
        ("+ LIMIT", "- LIMIT"),
        ("math.sqrt", "math.cbrt"),
        ("return math", "math"),
        ("import math", "import cmath as math"),
    ],
)
def test_everything_that_is_executed_counts(tmp_path: Path, old: str, new: str) -> None:
    assert old in CODE
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE.replace(old, new))


def test_a_string_that_is_used_counts(tmp_path: Path) -> None:
    assert digest(tmp_path, "name = 'one'") != digest(tmp_path, "name = 'two'")
    assert digest(tmp_path, "def f():\n    'one'") == digest(tmp_path, "def f():\n    'two'")


def test_order_of_the_files_does_not_count_but_name_and_number_do(tmp_path: Path) -> None:
    assert digest(tmp_path, CODE, "x = 1") == digest(tmp_path, "x = 1", CODE)
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE, CODE)
    assert digest(tmp_path, CODE) != digest(tmp_path, CODE, name="other.py")


def test_what_is_not_python_counts_by_its_bytes(tmp_path: Path) -> None:
    for name in ("code.so", "code.py"):
        assert digest(tmp_path, b"def \xff(", name=name) == digest(tmp_path, b"def \xff(", name=name)
        assert digest(tmp_path, b"def \xff(", name=name) != digest(tmp_path, b"def \xff( # 1", name=name)


def test_the_digest_is_the_same_with_every_version_of_python(tmp_path: Path) -> None:
    # Written down with 3.11. Versions differ in the empty fields that they give a function.
    text = "def f(a, *, b=1, **c) -> int:\n    return [a, f'{b!r:>3}', *c]\n\n\nclass G(dict): pass\n"
    assert digest(tmp_path, text).startswith("cc38c91d2d27")
