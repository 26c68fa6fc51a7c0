from __future__ import annotations

from collections.abc import Callable

import pytest

CONFTEST = """
import sys
from pathlib import Path

def pytest_sessionfinish():
    Path("modules.txt").write_text("\\n".join(sorted(sys.modules)))
"""


def test_a_played_pair_imports_nothing_of_the_construction(
    pytester: pytest.Pytester, run: Callable[..., pytest.RunResult]
) -> None:
    pytester.makeconftest(CONFTEST)
    run("--libero-max-limit=1", subprocess=True).assert_outcomes(passed=1)
    modules = (pytester.path / "modules.txt").read_text().split()
    assert "pytest_libero_max.pairing.runner" in modules
    assert not [name for name in modules if name.startswith("pytest_libero_max.construction")]
