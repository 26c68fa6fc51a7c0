"""A stranger's package plays Fetch of gymnasium-robotics: all events, an exact prefix, and it conforms."""

from __future__ import annotations

import ast
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
)

COMPARED = """
import numpy as np
from fetch_scene import FetchWorld

equal = 0
for task in (0, 1):
    world, begun = FetchWorld(task), FetchWorld(task)
    environment = begun._env  # stepped by itself from here on
    environment.goal = begun.position("ball")
    for action in np.random.default_rng(5).uniform(-1.2, 1.2, (20, 4)):
        world.step(action)
        environment.step(action)
        states = [(data.qpos.tobytes(), data.qvel.tobytes()) for data in (world.data, environment.data)]
        equal += states[0] == states[1]
print(f"equal: {equal} of 40")
"""


@pytest.fixture
def installed(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A folder with the package installed."""
    install(pytester, monkeypatch, PACKAGE)
    return pytester


def pairs_of(lines: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    pairs = {line["item_id"]: line for line in lines if line["line"] == "pair"}
    return {name: {key: value for key, value in pairs[name].items() if key != "timings"} for name in pairs}


@needs_fetch
def test_every_event_happens_and_a_fork_equals_a_replay(installed: pytest.Pytester, results: Results) -> None:
    written = installed.run(sys.executable, "fetch_world.py")
    installed.path.joinpath("fetch.json").write_text("\n".join(written.outlines))
    forked = installed.runpytest_subprocess(*RUN, "-k", "v1 and (t00 or target_relocation)")
    forked.assert_outcomes(passed=9, deselected=23)
    lines, report = results()
    pairs = pairs_of(lines)
    assert report["provenance"]["substrate"]["name"] == "fetch"
    assert {(pair["max_steps"], pair["policy"]["robot"]) for pair in pairs.values()} == {(50, "fetch")}
    assert all(pair["arms"]["dynamic"]["firings"] for pair in pairs.values())
    options = ("--libero-max-prefix=replay", "--libero-max-gate=base_sr >= 99%", "--libero-max-output=again")
    replayed = installed.runpytest_subprocess(
        *RUN, *options, "-k", "v1 and t00 and (target_ or distractor or noise)"
    )
    replayed.stdout.fnmatch_lines(["gate pass *base_sr*"])
    repeated = pairs_of(results("again")[0])
    assert len(repeated) == 3
    assert repeated == {name: pairs[name] for name in repeated}


@needs_fetch
def test_it_keeps_the_rules_of_substrates(installed: pytest.Pytester) -> None:
    done = installed.runpytest_subprocess(
        "-p", "no:cacheprovider", "--libero-max-conform=substrate:fetch", "-k", "not process"
    )
    outcomes = done.parseoutcomes()
    assert "failed" not in outcomes
    assert outcomes["passed"] == 25


@needs_fetch
def test_it_steps_as_the_environment_does(installed: pytest.Pytester) -> None:
    installed.makepyfile(compared=COMPARED)
    compared = installed.run(sys.executable, "compared.py")
    assert compared.outlines[-1] == "equal: 40 of 40", compared.errlines


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
