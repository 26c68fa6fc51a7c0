"""The table of entry-point groups names every group that the package reads, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest_libero_max
from pytest_libero_max.registry import ENTRY_POINTS

PACKAGE = Path(pytest_libero_max.__file__).parent
_GROUP = re.compile(r'(?:GROUP = |Registry\(\s*"[a-z ]+",\s*)"(pytest_libero_max\.[a-z_]+)"')


def test_every_group_that_is_read_is_in_the_table() -> None:
    read = {
        group
        for path in PACKAGE.rglob("*.py")
        for group in _GROUP.findall(path.read_text(encoding="utf-8"))
        if path.name != "registry.py" or path.parent != PACKAGE
    }
    assert read == set(ENTRY_POINTS)
