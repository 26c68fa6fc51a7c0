from __future__ import annotations

import contextlib
import os
import pty
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from pytest_libero_max.plugin.progress_display import RunProgress
from pytest_libero_max.runs.progress import Pace
from pytest_libero_max.runs.status import Follower
from tests.report.made_up import plan, record_of
from tests.terminal import Terminal
from tests.warm_processes import WarmProcess

Run = Callable[..., pytest.RunResult]

LIVE = re.compile(r"libero-max: \d of 2 pairs, .*P \d R \d N \d E 0, playing \S+camera_shift-v\d")


def _in_a_terminal(folder: Path, *arguments: str) -> str:
    """Everything that pytest writes to a terminal of 100 columns."""
    leader, follower = pty.openpty()
    environment = {**os.environ, "COLUMNS": "140", "LINES": "40", "TERM": "xterm"}
    options = [
        "--libero-max-policy=adapter.py",
        "--libero-max-manifest=tiny.json",
        "--libero-max-substrate=tiny",
    ]
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *options, *arguments]
    process = WarmProcess(command, cwd=folder, env=environment, stdout=follower, stderr=follower)
    os.close(follower)
    written = b""
    with contextlib.suppress(OSError):  # Linux says so where nobody holds the other side any more
        while part := os.read(leader, 65536):
            written += part
    os.close(leader)
    assert process.wait() == 0, written.decode()
    return written.decode()


def test_a_live_line_is_composed_ten_times_a_second_at_most(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    drawn, now = list[str](), [100.0]
    terminal = SimpleNamespace(width_of_current_line=0)
    progress = RunProgress(cast("Any", SimpleNamespace(get_terminal_writer=lambda: terminal)), "live")
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    values = {
        "_live": SimpleNamespace(draw=lambda lines, _: drawn.append(lines[0]), erase=lambda: None),
        "_store": SimpleNamespace(path=tmp_path / "pairs.jsonl", note=lambda _: None),
        "_reporter": SimpleNamespace(flush=lambda: None),
    }
    for name, value in values.items():
        monkeypatch.setattr(progress, name, value)
    progress._counts.planned = planned = plan()
    for number, later_s in enumerate((0.0, 0.04, 0.04, 0.04)):
        now[0] += later_s
        progress.pytest_libero_max_pair_stored(record_of(planned[number], True, True))
        progress._draw()
        assert progress._stale == (number in (1, 2))
    assert [line.split(" of ")[0] for line in drawn] == [f"libero-max: {count}" for count in (1, 1, 1, 4)]


@pytest.mark.parametrize("arguments", [["-q"], ["-v", "-n1"]], ids=" ".join)
def test_a_live_line_leaves_nothing_in_the_output(
    run: Run, pytester: pytest.Pytester, arguments: list[str]
) -> None:
    every = ["-k", "camera_shift", *arguments]
    written = _in_a_terminal(pytester.path, *every)
    assert LIVE.search(written)
    terminal = Terminal(140)
    terminal.feed(written)
    without = Terminal(140)
    without.feed(_in_a_terminal(pytester.path, *every, "--libero-max-progress=none"))
    assert _comparable(terminal) == _comparable(without)


def _comparable(terminal: Terminal) -> list[str]:
    times = r"in \d+\.\d+s( \(.*\))?|=+$|^=+|\d+(\.\d+)? ms"
    return [re.sub(times, "", row) for row in terminal.shown()]


def test_where_there_is_no_terminal_there_are_lines(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pace, "due", lambda self, now: True)
    result = run("-k", "camera_shift")
    lines = [line for line in result.outlines if re.match(r"libero-max: \d of 2 pairs, ", line)]
    assert lines[0] == "libero-max: 0 of 2 pairs, P 0 R 0 N 0 E 0"
    assert re.fullmatch(
        r"libero-max: 1 of 2 pairs, P 0 R 0 N 1 E 0, .*/min(, .* left \(ready at .*\))?", lines[-1]
    )
    for quiet in ("-q", "--libero-max-progress=none"):
        assert "libero-max: 1 of 2 pairs, " not in run("-k", "camera_shift", quiet).stdout.str()


def test_a_form_that_is_none_is_refused(run: Run) -> None:
    result = run("--libero-max-progress=loud")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--libero-max-progress='loud': unknown value*"])


def test_a_run_notes_what_its_workers_play(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
        from pathlib import Path

        from pytest_libero_max.runs.status import Follower

        def pytest_runtest_logreport(report):
            if report.when == "setup" and hasattr(report, "node"):
                seen = Follower(Path("libero-max-results")).look()
                with open("seen.txt", "a") as file:
                    print(seen.state, seen.progress.done, *seen.progress.workers.items(), file=file)
        """
    )
    run("-k", "camera_shift", "-n", "1", subprocess=True).assert_outcomes(passed=2)
    item = "libero-spatial-t00-i00-camera_shift"
    assert (pytester.path / "seen.txt").read_text().splitlines() == [
        f"running 0 ('{item}-v0', 'gw0')",
        f"running 1 ('{item}-v1', 'gw0')",
    ]
    assert Follower(pytester.path / "libero-max-results").look().state == "ended"


def test_a_resumed_run_counts_what_was_measured_before(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Pace, "due", lambda self, now: True)
    stop = pytester.makeconftest("def pytest_libero_max_pair_stored(pair): raise KeyboardInterrupt")
    assert run("-k", "camera_shift", subprocess=True).ret == pytest.ExitCode.INTERRUPTED
    stop.unlink()
    result = run("-k", "camera_shift", "--libero-max-resume")
    lines = [line for line in result.outlines if re.match(r"libero-max: \d of 2 pairs, ", line)]
    assert len(lines) == 1
    assert re.fullmatch(
        r"libero-max: 1 of 2 pairs, P 0 R 0 N 1 E 0(, \d+ s left \(ready at \S+\))?", lines[0]
    )
