"""The selection of tests for before a commit."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import pytest

from tests import quick

ROOT = Path(__file__).parents[1]

JUNIT = """<testsuites><testsuite>
<testcase classname="tests.a.test_b" name="test_one[x]" time="0.1"/>
<testcase classname="tests.a.test_b" name="test_one[y]" time="0.7"/>
<testcase classname="tests.a.test_b" name="test_two" time="{two}"/>
</testsuite></testsuites>"""


def test_every_slow_function_is_one() -> None:
    by_file = defaultdict(set)
    for name in quick.slow_functions():
        file, _, function = name.partition("::")
        by_file[file].add(function)
    for file, functions in by_file.items():
        text = (ROOT / file).read_text(encoding="utf-8")
        assert functions <= set(re.findall(r"^def (test_\w+)\(", text, re.M)), file


def test_only_functions_that_are_not_listed_are_quick(request: pytest.FixtureRequest) -> None:
    items = [item for item in request.session.items if isinstance(item, pytest.Function)]
    assert request.node.get_closest_marker("quick")
    for item in items:
        listed = f"{item.location[0]}::{item.originalname}" in quick.slow_functions()
        assert (item.get_closest_marker("quick") is None) == listed


@pytest.mark.parametrize(("two", "status"), [("539.0", 0), ("541.0", 1)])
def test_quick_tests_that_take_too_long_are_told(
    two: str, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "junit.xml"
    file.write_text(JUNIT.format(two=two))
    monkeypatch.setattr(quick, "slow_functions", lambda: {"tests/a/test_b.py::test_one"})
    assert quick.main([str(file)]) == status
    assert f"quick: 1 tests, {two.partition('.')[0]} s" in capsys.readouterr().out
    assert quick.slow_of(quick.durations(file)) == [
        "tests/a/test_b.py::test_one",
        "tests/a/test_b.py::test_two",
    ]
