"""A stranger's package plays Fetch of gymnasium-robotics: all events, an exact prefix, and it conforms."""

from __future__ import annotations

import ast
from importlib.util import find_spec
from pathlib import Path

import pytest

import pytest_libero_max

PACKAGE = Path(__file__).with_name("fetch_world")
MOST_LINES = 400

needs_fetch = pytest.mark.skipif(
    find_spec("gymnasium_robotics") is None,
    reason="gymnasium-robotics is not installed: pip install --no-deps -r .ci/peers.txt",
)


@needs_fetch
def test_it_plays_every_event_with_an_exact_prefix() -> None:
    pass


def test_it_is_short_and_imports_public_names_alone() -> None:
    files = [*PACKAGE.glob("*.py")]
    assert sum(len(file.read_text().splitlines()) for file in files) <= MOST_LINES
    imported = {
        f"{node.module}.{alias.name}"
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("pytest_libero_max")
        for alias in node.names
    }
    public = {f"pytest_libero_max.{name}" for name in pytest_libero_max.__all__}
    assert imported <= public | {"pytest_libero_max.errors.SubstrateError"}
