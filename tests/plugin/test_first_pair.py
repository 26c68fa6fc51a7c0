from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from pytest_libero_max.evaluation.player import AGAIN_AFTER
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from tests.plugin.conftest import REACHER, tiny_manifest

REMEMBERING = REACHER.replace("        pass", "        self.suites.add(episode.suite)")
REMEMBERING = REMEMBERING.replace("    def reset", "    suites = set()\n\n    def reset")
REMEMBERING = REMEMBERING.replace(
    "        return", "        action[3] = 0.01 * len(self.suites)\n        return"
)
"""Counts the suites that it has seen and acts on it: alike within a pair, however often it is asked."""

SUITES = ("libero_10", "libero_goal", "libero_object", "libero_spatial")


@pytest.fixture
def suites(pytester: pytest.Pytester) -> None:
    """Four cases of each suite."""
    manifest = tiny_manifest(events=BENCHMARK_EVENTS[:2], suites=SUITES)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(manifest))


def test_a_policy_that_remembers_across_pairs_is_found_and_the_run_stopped(
    pytester: pytest.Pytester, run: Callable[..., pytest.RunResult], suites: None
) -> None:
    pytester.makepyfile(remembering=REMEMBERING)
    result = run(policy="remembering.py")
    result.assert_outcomes(passed=AGAIN_AFTER - 1, errors=1)
    result.stdout.fnmatch_lines(
        [
            f"RefusalError: the policy remembers something from pair to pair: * again after {AGAIN_AFTER} "
            "pairs, and base came out otherwise*"
        ]
    )
    assert result.ret == 11


@pytest.mark.parametrize("repeatable", [True, False])
def test_other_policies_are_played_to_the_end(
    repeatable: bool, pytester: pytest.Pytester, run: Callable[..., pytest.RunResult], suites: None
) -> None:
    adapter = (
        REACHER if repeatable else REMEMBERING.replace("image_size=64", "image_size=64, repeatable=False")
    )
    pytester.makepyfile(other=adapter)
    result = run(policy="other.py")
    result.assert_outcomes(passed=2 * AGAIN_AFTER)
    assert result.ret == 0
