"""What was measured is kept and summed up, whatever breaks beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.test_run import Results, Run, identities

LEAVING = """
import os
from adapter import Reacher

class Leaving(Reacher):
    def reset(self, episode):
        if os.path.exists("armed"):
            os._exit(0)

policy = Leaving
"""


def test_a_run_that_is_killed_leaves_no_result_and_goes_on(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(leaving=LEAVING)
    run("--libero-max-limit=1", policy="leaving.py")
    folder = Path(pytester.path) / "libero-max-results"
    assert (folder / "report.json").exists()
    (pytester.path / "armed").touch()
    assert run("--libero-max-limit=1", policy="leaving.py", subprocess=True).ret == 0, "it cannot say"
    assert not (folder / "report.json").exists()
    with pytest.raises(ReportError, match="was killed before"):
        read_pairs(folder)
    (pytester.path / "armed").unlink()
    result = run("--libero-max-limit=1", "--libero-max-resume", policy="leaving.py")
    assert result.ret == 0
    assert results()[1]["pairs"]["complete"]
    assert len(read_pairs(folder).records) == 1


def test_a_torn_first_line_goes_on(run: Run, pytester: pytest.Pytester) -> None:
    folder = pytester.mkdir("libero-max-results")
    (folder / "pairs.jsonl").write_text('{"line":"run","schema_ver')
    assert run("--libero-max-limit=1", "--libero-max-resume").ret == 0
    assert len(read_pairs(folder).records) == 1


def test_reports_that_cannot_be_written_hide_no_summary(run: Run, pytester: pytest.Pytester) -> None:
    folder = pytester.mkdir("libero-max-results")
    (folder / "report.json").mkdir()
    (folder / "traces").write_text("")
    pytester.makeconftest(
        """
        import os

        os.environ["GITHUB_ACTIONS"] = "true"
        os.environ["GITHUB_STEP_SUMMARY"] = "missing/summary.md"

        def pytest_unconfigure():
            del os.environ["GITHUB_ACTIONS"], os.environ["GITHUB_STEP_SUMMARY"]
        """
    )
    result = run("--libero-max-limit=1", "--libero-max-traces=all")
    assert result.ret == 11
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(
        [
            "*1 of 1 planned pairs*",
            "Base success*",
            "Written: *pairs.jsonl, *report.md, *report.html",
            "The step summary was not written: *",
            "Beside the pairs, which are measured: no trace of *",
            "Cannot write *report.json*",
            "Exit status 11: not everything could be written.*",
        ]
    )
    assert len(read_pairs(folder).records) == 1


def test_a_full_disk_stops_the_run_and_keeps_what_was_written(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
        import os

        from pytest_libero_max.runs import store

        count = 0
        fsync = os.fsync

        def full(descriptor):
            global count
            count += 1
            if count == 3:  # the header, a pair, and then
                raise OSError("No space left on device")
            fsync(descriptor)

        def pytest_configure():
            os.fsync, store.SYNC_S = full, 0.0  # each line is waited for

        def pytest_unconfigure():
            os.fsync, store.SYNC_S = fsync, 0.5
        """
    )
    result = run("--libero-max-limit=3")
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        ["Cannot write *No space left on device*", "INCOMPLETE: *", "Exit status 11*resume*"]
    )
    assert read_pairs(Path(pytester.path) / "libero-max-results").records


def test_a_hook_that_raises_at_the_end_costs_no_report(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest("def pytest_sessionfinish(): raise RuntimeError('at the end')")
    run("--libero-max-limit=1")
    assert results()[1]["pairs"]["complete"]


def test_stopping_at_the_first_failure_on_workers_is_an_incomplete_run(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        failing="""
        from adapter import Reacher

        class Failing(Reacher):
            def predict(self, observation, query):
                raise RuntimeError("never")

        policy = Failing
        """
    )
    assert run("-n2", "-x", policy="failing.py", subprocess=True).ret == 11
    assert results()[1]["pairs"]["missing"] > 0


def test_a_damaged_line_is_said_kept_and_its_pair_played_again(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    run("-k", "camera_shift or illumination_switch")
    before = identities(results()[0])
    path = Path(pytester.path) / "libero-max-results" / "pairs.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], lines[2][:200] + b"\n", *lines[3:]]))
    result = run("-k", "camera_shift or illumination_switch", "--libero-max-resume")
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(
        ["1 damaged line of the pairs measured before*pairs.damaged*line 3: not JSON*"]
    )
    assert identities(results()[0]) == before
    assert path.with_name("pairs.damaged").read_bytes() == lines[2][:200] + b"\n"
