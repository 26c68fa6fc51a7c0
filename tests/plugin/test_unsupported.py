"""Pairs of suites that a policy declares it does not support."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

import pytest

from tests.plugin.conftest import REACHER, tiny_manifest

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]


@pytest.fixture
def partial(pytester: pytest.Pytester, run: Run) -> Run:
    """Runs a policy that supports one of the two suites of the manifest."""
    pytester.makepyfile(adapter=REACHER.replace("image_size=64", "image_size=64, suites=('libero_goal',)"))
    manifest = tiny_manifest(events=("camera_shift",), suites=("libero_spatial", "libero_goal"))
    pytester.path.joinpath("tiny.json").write_text(json.dumps(manifest))
    return run


def test_unsupported_pairs_are_skipped_with_the_reason(
    partial: Run, results: Results, pytester: pytest.Pytester
) -> None:
    result = partial("--junitxml=junit.xml", "--libero-max-gate=unsupported <= 2")
    result.assert_outcomes(passed=2, skipped=2)
    assert result.ret == 0
    lines, report = results()
    assert {line["suite"] for line in lines} == {"libero_goal"}
    assert (report["pairs"]["played"], report["pairs"]["unsupported"]) == (2, 2)
    result.stdout.fnmatch_lines(
        [
            "*all 4 cases, 2 of them",
            "unsupported:",
            "PARTIAL: the policy does not support libero_spatial. Its 2 pairs*",
        ]
    )
    skips = ET.parse(pytester.path / "junit.xml").getroot().findall(".//skipped")
    assert len(skips) == 2
    assert "declares the suites libero_goal" in str(skips[0].get("message"))


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_the_limit_chooses_among_the_suites_that_are_named(
    partial: Run, results: Results, workers: tuple[str, ...]
) -> None:
    result = partial("--libero-max-limit=2", "--libero-max-output=before", *workers, subprocess=True)
    result.assert_outcomes(passed=1, skipped=1)
    result.stdout.fnmatch_lines("*--libero-max-limit=2 chose*1 pair*--libero-max-suites=libero_goal")
    suites = "--libero-max-suites=libero_goal"
    result = partial("--libero-max-limit=2", suites, *workers, subprocess=True)
    result.assert_outcomes(passed=2)
    assert "chose before the" not in result.stdout.str()
    lines, report = results()
    assert {line["suite"] for line in lines} == {"libero_goal"}
    selection = report["selection"]
    assert (selection["chosen"], selection["of"]) == (2, 4)
    assert selection["asked"] == [suites, "--libero-max-limit=2"]


def test_suites_that_leave_no_pair_or_are_none_are_named(partial: Run) -> None:
    result = partial("--libero-max-suites=libero_10")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    result.stdout.fnmatch_lines("No pair was chosen: --libero-max-suites=libero_10 leave none of 4 cases.")
    result = partial("--libero-max-suites=libero_goal,spatial")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines("*--libero-max-suites='libero_goal,spatial'*'libero_spatial'*")


def test_a_run_of_unsupported_pairs_alone_is_incomplete(partial: Run) -> None:
    result = partial("-k", "spatial")
    result.assert_outcomes(skipped=2)
    assert result.ret == 11
