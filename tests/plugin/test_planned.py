"""Pairs are planned and counted by their cases, whatever their tests are called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from pytest_libero_max.plugin.controller import RunController
from tests.plugin.test_run import Results, Run

RENAMING = """
import pytest

def pytest_collection_modifyitems(items):
    for number, item in enumerate(items):
        item._nodeid = f"test number {number}"
        item.name = f"number {number}"
"""

PARAMETRISED = """
import pytest

@pytest.fixture(autouse=True, params={params})
def parameter(request):
    return request.param
"""


@pytest.mark.parametrize(
    ("conftest", "workers"),
    [(RENAMING, ()), (PARAMETRISED.format(params=["a"]), ()), (PARAMETRISED.format(params=["a"]), ("-n1",))],
    ids=["renamed", "parametrised", "distributed"],
)
def test_a_pair_whose_test_is_called_otherwise_is_planned_and_stored(
    run: Run, results: Results, pytester: pytest.Pytester, conftest: str, workers: tuple[str, ...]
) -> None:
    pytester.makeconftest(conftest)
    result = run("--libero-max-limit=2", "--libero-max-gate=missing == 0", *workers)
    assert result.ret == 0
    lines, report = results()
    assert [line["line"] for line in lines] == ["pair", "pair"]
    assert report["pairs"]["complete"]
    result.stdout.fnmatch_lines(["gate pass*"])


def test_a_pair_with_two_tests_is_refused(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(PARAMETRISED.format(params=["a", "b"]))
    result = run("--libero-max-limit=2")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "2 tests, but a pair" in result.stdout.str() + result.stderr.str()
    assert not (pytester.path / "libero-max-results" / "pairs.jsonl").exists()


def test_a_renamed_pair_that_was_measured_is_not_played_again(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(RENAMING)
    run("--libero-max-limit=2")
    result = run("--libero-max-limit=2", "--libero-max-resume")
    result.assert_outcomes(deselected=2)
    assert result.ret == 0
    assert results()[1]["pairs"]["played"] == 2


RERUNNING = """
from _pytest.runner import runtestprotocol

def pytest_runtest_protocol(item, nextitem):  # as pytest-rerunfailures plays a test again
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in range(2):
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        again = attempt == 0 and any(report.failed for report in reports)
        for report in reports:
            if again and report.failed:
                report.outcome = "rerun"
            item.ihook.pytest_runtest_logreport(report=report)
        if not again:
            break
        item._initrequest()
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True

def pytest_report_teststatus(report):
    if report.outcome == "rerun":
        return "rerun", "R", "RERUN"
"""

FAILING_ONCE = """
from adapter import Reacher

class Once(Reacher):
    failed = False
    def predict(self, observation, query):
        if not Once.failed:
            Once.failed = True
            raise RuntimeError("the camera fell off")
        return super().predict(observation, query)

policy = Once
"""


def test_a_pair_that_is_played_again_after_an_error_counts_and_is_named(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest(RERUNNING)
    pytester.makepyfile(once=FAILING_ONCE)
    result = run("-k", "camera_shift", policy="once.py")
    assert result.ret == 0
    lines, report = results()
    assert [line["line"] for line in lines] == ["error", "pair", "pair"]
    assert report["pairs"]["complete"]
    assert report["pairs"]["repaired_pairs"] == ["libero-spatial-t00-i00-camera_shift-v0"]
    result.stdout.fnmatch_lines(
        ["Measured when played again after an error: 1 pair (libero-spatial-t00-i00-camera_shift-v0)."]
    )


def test_gates_without_a_policy_are_refused(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_it(): pass")
    result = pytester.runpytest("--libero-max-gate=missing == 0")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--libero-max-gate is given, but no pair is played*"])


def test_ids_that_all_workers_collect_are_planned_and_kept_once() -> None:
    planned = list[list[str]]()
    controller = SimpleNamespace(_collected=[], _plan=lambda ids: planned.append(list(ids)))
    lists = [["".join(["pair ", name]) for name in "ab"] for _ in range(3)]  # each with strings of its own
    for ids in (*lists, ["pair a"]):
        RunController.pytest_xdist_node_collection_finished(cast("Any", controller), None, ids)
    assert planned == [["pair a", "pair b"], ["pair a"]]
    assert all(ours is first for ids in lists for ours, first in zip(ids, lists[0], strict=True))
