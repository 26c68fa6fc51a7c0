"""A stranger's package plays Fetch of gymnasium-robotics: all events, an exact prefix, and it conforms."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import pytest_libero_max
from tests.plugin.strangers import install

Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

PACKAGE = Path(__file__).with_name("fetch_world")
MOST_LINES = 400

needs_fetch = pytest.mark.skipif(
    find_spec("gymnasium_robotics") is None,
    reason="gymnasium-robotics is not installed: pip install --no-deps -r .ci/peers.txt",
)

RUN = (
    "-p",
    "no:cacheprovider",
    "--libero-max-substrate=fetch",
    "--libero-max-manifest=fetch.json",
    "--libero-max-policy=fetch-scripted",
    "-k",
    "i00 and v1",
)


@pytest.fixture
def installed(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A folder with the package installed and its manifest."""
    install(pytester, monkeypatch, PACKAGE)
    written = pytester.run(sys.executable, "fetch_world.py")
    pytester.path.joinpath("fetch.json").write_text("\n".join(written.outlines))
    return pytester


def pairs_of(lines: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    pairs = {line["item_id"]: line for line in lines if line["line"] == "pair"}
    return {name: {key: value for key, value in pairs[name].items() if key != "timings"} for name in pairs}


@needs_fetch
def test_every_event_happens_and_a_fork_equals_a_replay(installed: pytest.Pytester, results: Results) -> None:
    forked = installed.runpytest_subprocess(*RUN, "--libero-max-gate=base_sr >= 99%")
    forked.assert_outcomes(passed=16, deselected=16)
    forked.stdout.fnmatch_lines(["gate pass *base_sr*"])
    lines, report = results()
    pairs = pairs_of(lines)
    assert report["provenance"]["substrate"]["name"] == "fetch"
    assert {(pair["max_steps"], pair["policy"]["robot"]) for pair in pairs.values()} == {(50, "fetch")}
    assert all(pair["arms"]["dynamic"]["firings"] for pair in pairs.values())
    replayed = installed.runpytest_subprocess(
        *RUN, "--libero-max-prefix=replay", "--libero-max-output=replayed"
    )
    replayed.assert_outcomes(passed=16, deselected=16)
    assert pairs_of(results("replayed")[0]) == pairs


@needs_fetch
def test_it_keeps_the_rules_of_substrates(installed: pytest.Pytester) -> None:
    done = installed.runpytest_subprocess("-p", "no:cacheprovider", "--libero-max-conform=substrate:fetch")
    document = json.loads(Path(installed.path, "libero-max-results", "conformance.json").read_text())
    assert document["conforms"]
    assert done.ret == pytest.ExitCode.OK


def test_it_is_short_and_imports_public_names_alone() -> None:
    files = [*PACKAGE.glob("*.py")]
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files) <= MOST_LINES
    imported = {
        f"{node.module}.{alias.name}"
        for file in files
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("pytest_libero_max")
        for alias in node.names
    }
    public = {f"pytest_libero_max.{name}" for name in pytest_libero_max.__all__}
    assert imported <= public | {"pytest_libero_max.errors.SubstrateError"}
