from __future__ import annotations

import contextlib
import os
import pty
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.runs.progress import Pace
from pytest_libero_max.runs.status import Follower
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
                    print(seen.state, seen.progress.done, *seen.progress.playing, file=file)
        """
    )
    run("-k", "camera_shift", "-n", "1", subprocess=True).assert_outcomes(passed=2)
    item = "libero-spatial-t00-i00-camera_shift"
    assert (pytester.path / "seen.txt").read_text().splitlines() == [
        f"running 0 {item}-v0",
        f"running 1 {item}-v1",
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
    assert re.fullmatch(r"libero-max: 1 of 2 pairs, P 0 R 0 N 1 E 0", lines[0])
