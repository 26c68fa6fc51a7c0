from __future__ import annotations

import gc
import re
from collections.abc import Callable
from typing import Any

import pytest

from pytest_libero_max.plugin.pair_reports import packed, unpacked
from pytest_libero_max.plugin.stash_keys import RESULT_ATTRIBUTE
from tests.plugin.conftest import BUDGET
from tests.plugin.test_run import Results, Run

FROZEN = ""
"""In the place of the plugin that shortens episodes with a table that can be edited."""


@pytest.mark.parametrize(("arm", "workers"), [("base", "-n0"), ("dynamic", "-n1")])
def test_episodes_of_another_length_are_not_stored(
    run: Run, results: Results, pytester: pytest.Pytester, arm: str, workers: str
) -> None:
    """Also where one arm alone is longer, in the process that stores the pairs."""
    pytester.makepyfile(
        longer=f"""
        from adapter import Reacher
        from pytest_libero_max.benchmark import cases

        class policy(Reacher):
            episodes = 0

            def reset(self, episode):
                self.episodes += 1
                if self.episodes == {1 if arm == "base" else 2}:
                    cases.step_budget = lambda suite: 35
        """
    )
    result = run("-k", "camera_shift and v0", workers, policy="longer.py", subprocess=True)
    (error,) = [line for line in results()[0] if line["line"] == "error"]
    assert "max_steps=35" in error["message"]
    assert re.search(f"(its episodes have|libero_spatial has) {BUDGET}", error["message"])
    assert result.ret == 11


def test_budgets_cannot_be_edited(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        longer="""
        from adapter import Reacher
        from pytest_libero_max.benchmark.suites import SUITES

        class policy(Reacher):
            def reset(self, episode):
                SUITES["libero_spatial"].budget = 35
        """
    )
    pytester.makepyfile(short_episodes=FROZEN)
    result = run("-k", "camera_shift and v0", policy="longer.py", subprocess=True)
    (error,) = [line for line in results()[0] if line["line"] == "error"]
    assert error["kind"] == "AdapterError"
    assert "cannot assign to" in error["message"]
    assert result.ret == 11


@pytest.mark.parametrize(
    ("result", "sent"),
    [
        ({"arms": {"base": {"steps": 3, "shares": None}}, "m": [0.1, float("inf")]}, str),
        ({"note": b"bytes"}, dict),
        (None, type(None)),
    ],
)
def test_a_result_travels_as_one_text_where_json_knows_all_of_it(result: Any, sent: type) -> None:
    data = packed({RESULT_ATTRIBUTE: result, "outcome": "passed"})
    assert data is not None
    assert isinstance(data[RESULT_ATTRIBUTE], sent)
    assert unpacked(data) == {RESULT_ATTRIBUTE: result, "outcome": "passed"}


def test_reports_of_other_tests_are_sent_as_they_are() -> None:
    assert packed(None) is None
    assert packed({"outcome": "failed"}) == unpacked({"outcome": "failed"}) == {"outcome": "failed"}


def test_xdist_sends_results_as_text(pytester: pytest.Pytester, run: Callable[..., pytest.RunResult]) -> None:
    pytester.makeconftest(
        """
        from pathlib import Path
        import pytest

        @pytest.hookimpl(wrapper=True, tryfirst=True)
        def pytest_report_from_serializable(data):
            if data.get("libero_max") is not None:
                Path("sent.txt").write_text(type(data["libero_max"]).__name__)
            return (yield)
        """
    )
    run("--libero-max-limit=1", "-n1", subprocess=True).assert_outcomes(passed=1)
    assert (pytester.path / "sent.txt").read_text() == "str"


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["plain", "one worker"])
def test_no_record_stays_in_memory_with_its_report(
    pytester: pytest.Pytester, run: Callable[..., pytest.RunResult], workers: tuple[str, ...]
) -> None:
    pytester.makeconftest(
        f"""
        def pytest_runtest_logreport(report):
            if report.when == "call":
                assert {RESULT_ATTRIBUTE!r} in vars(report)

        def pytest_terminal_summary(terminalreporter):
            kept = [report for reports in terminalreporter.stats.values() for report in reports]
            print("kept", len(kept), sum({RESULT_ATTRIBUTE!r} in vars(report) for report in kept))
        """
    )
    done = run("-k", "camera_shift", "-rA", *workers, subprocess=True)
    assert done.ret == 0
    done.stdout.fnmatch_lines(["*short test summary info*", "*Base *after*"])
    assert re.search(r"^kept [1-9]\d* 0$", str(done.stdout), re.MULTILINE)


def test_properties_that_another_process_sent_are_tuples_which_the_collector_does_not_look_at() -> None:
    data = unpacked({"outcome": "passed", "user_properties": [["libero_max_outcome", "robust_success"]]})
    (pair,) = data["user_properties"]
    assert pair == ("libero_max_outcome", "robust_success")
    gc.collect()
    assert not gc.is_tracked(pair)
