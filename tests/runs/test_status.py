from __future__ import annotations

import errno
import gzip
import os
import re
import socket
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.lock import MARK_NAME
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.status import Follower
from pytest_libero_max.runs.store import PairStore
from tests.report.made_up import POLICY, PROVENANCE, error_of, kill, plan, record_of

RUN = Run(tuple(plan()[:4]), PROVENANCE)


def _begin(folder: Path, pairs: int = 2) -> PairStore:
    store = PairStore(folder, RUN)
    store.begin()
    item = RUN.planned[pairs].item_id
    store.note({"began": 1000.0, "now": 1060.0, "before": 0, "playing": {item: 1050.0}})
    for pair in RUN.planned[:pairs]:
        store.append(record_of(pair, True, False, timings={"pair_s": 25.0}))
    return store


def test_a_run_is_followed_from_its_first_line_to_its_end(tmp_path: Path) -> None:
    follower = Follower(tmp_path)
    with pytest.raises(ReportError, match="that has begun"):
        follower.look()
    store = _begin(tmp_path)
    seen = follower.look()
    assert seen.state == "running"
    lines = seen.lines()
    assert f", running (process {os.getpid()} on " in lines[0]
    assert lines[1:3] == ["2 of 4 pairs, 2.0/min, 60 s left", "P 0 R 2 N 0 E 0"]
    assert lines[3].startswith("playing for 10 s: plus-")
    pair = RUN.planned[2]
    store.append(error_of(pair))
    assert follower.look().lines()[2] == "P 0 R 2 N 0 E 1"
    store.append(record_of(RUN.planned[3], True, True))
    store.close()
    seen = follower.look()
    assert seen.state == "ended"
    assert not seen.complete
    assert seen.lines()[0].endswith(", ended incomplete: 1 with an error")
    assert seen.lines()[1:] == ["4 of 4 pairs", "P 1 R 2 N 0 E 1"]


def test_a_killed_run_is_called_killed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kill(_begin(tmp_path))
    seen = Follower(tmp_path).look()
    assert seen.state == "killed"
    assert "killed before it" in seen.lines()[0]
    assert "--libero-max-resume" in seen.lines()[0]
    assert not any("left" in line or "playing" in line for line in seen.lines())
    for options in ([], ["--once"]):
        assert main(["runs", "--follow", str(tmp_path), *options]) == 11
        assert capsys.readouterr().out.splitlines()[1:] == ["2 of 4 pairs", "P 0 R 2 N 0 E 0"]


def test_what_cannot_be_seen_of_another_machine_is_not_said(tmp_path: Path) -> None:
    kill(_begin(tmp_path))
    mark = tmp_path / MARK_NAME
    mark.write_text(mark.read_text().replace(socket.gethostname(), "elsewhere"))
    os.utime(mark, (0, 0))
    seen = Follower(tmp_path).look()
    assert seen.state == "unknown"
    assert "cannot be seen" in seen.lines()[0]


def test_a_file_system_without_locks_makes_no_run_a_killed_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    store = _begin(tmp_path)
    monkeypatch.setattr("fcntl.flock", refuse)
    seen = Follower(tmp_path).look()
    assert seen.state == "unknown"
    assert seen.lines()[3].startswith("playing for 10 s: ")
    store.close()
    assert Follower(tmp_path).look().state == "ended"


def test_a_run_that_says_nothing_for_long_is_called_quiet(tmp_path: Path) -> None:
    store = _begin(tmp_path)
    os.utime(tmp_path / MARK_NAME, (0, 0))
    assert "quiet for " in Follower(tmp_path).look().lines()[0]
    store.close()


def test_a_run_is_followed_through_a_note_that_is_half_written(tmp_path: Path) -> None:
    store = _begin(tmp_path)
    mark = tmp_path / MARK_NAME
    for rest in ("", '{"began": 10', '{"began": "x"}', "[]", '{"began":1,"now":2,"before":0,"playing":3}'):
        mark.write_text(mark.read_text().splitlines()[0] + "\n" + rest)
        assert Follower(tmp_path).look().lines()[1] == "2 of 4 pairs"
    store.close()


def test_another_run_in_the_folder_is_followed_from_its_beginning(tmp_path: Path) -> None:
    _begin(tmp_path).close()
    follower = Follower(tmp_path)
    assert follower.look().progress.done == 2
    again = _begin(tmp_path, 1)
    assert follower.look().progress.done == 1
    again.close()


def test_pairs_of_suites_that_the_policy_does_not_support_are_not_waited_for(tmp_path: Path) -> None:
    planned = plan(per_cell=2)[:4]
    store = PairStore(tmp_path, Run(tuple(planned), PROVENANCE))
    supported = [pair for pair in planned if pair.suite == "libero_spatial"]
    for pair in supported:
        store.append(record_of(pair, True, True, policy={**POLICY, "suites": ["libero_spatial"]}))
    store.close()
    seen = Follower(tmp_path).look()
    assert seen.complete
    assert seen.lines()[1] == "2 of 2 pairs"


def test_a_published_run_has_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = _begin(tmp_path)
    for pair in RUN.planned[2:]:
        store.append(record_of(pair, True, True))
    store.close()
    pairs = tmp_path / "pairs.jsonl"
    (tmp_path / "pairs.jsonl.gz").write_bytes(gzip.compress(pairs.read_bytes()))
    pairs.unlink()
    assert main(["runs", "--follow", str(tmp_path)]) == 0
    assert capsys.readouterr().out.endswith(", ended\n4 of 4 pairs\nP 2 R 2 N 0 E 0\n")


def test_a_damaged_line_is_named(tmp_path: Path) -> None:
    store = _begin(tmp_path)
    with (tmp_path / "pairs.jsonl").open("a") as file:
        file.write("{}\n")
    with pytest.raises(ReportError, match="line 4: line=None"):
        Follower(tmp_path).look()
    store.close()


def test_watch_ends_with_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    store = _begin(tmp_path)
    slept: list[float] = []

    def end_the_run(seconds: float) -> None:
        slept.append(seconds)
        if len(slept) == 2:
            for pair in RUN.planned[2:]:
                store.append(record_of(pair, True, True))
            store.close()

    monkeypatch.setattr("time.sleep", end_the_run)
    assert main(["runs", "--follow", str(tmp_path), "--interval=7"]) == 0
    assert slept == [7.0, 7.0]
    lines = capsys.readouterr().out.splitlines()
    assert "running (process" in lines[0]
    assert lines[-3].endswith(", ended")
    assert lines[-2:] == ["4 of 4 pairs", "P 2 R 2 N 0 E 0"]


def test_several_runs_are_followed_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = _begin(tmp_path / "1"), _begin(tmp_path / "2", 1)
    assert main(["runs", "--follow", str(tmp_path / "1"), str(tmp_path / "2"), "--once"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.search(r", 2 of 4 pairs, P 0 R 2 N 0 E 0, [12]\.\d/min, \d+ (s|min) left$", lines[0])
    assert re.search(r", 1 of 4 pairs, P 0 R 1 N 0 E 0, [01]\.\d/min, \d min left$", lines[1])
    assert re.fullmatch(
        r"3 of 8 pairs of 2 runs, [23]\.\d/min, \d min left \(ready at .*\), P 0 R 3 N 0 E 0", lines[2]
    )
    for store in (one, other):
        store.close()
    assert main(["runs", "--follow", str(tmp_path / "1"), str(tmp_path / "2")]) == 11
    lines = capsys.readouterr().out.splitlines()
    assert "incomplete: 2 missing, 2 of 4" in lines[0]
    assert lines[2] == "3 of 8 pairs of 2 runs, P 0 R 3 N 0 E 0"


def test_what_watch_cannot_use_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", "--follow", str(tmp_path)]) == 1
    assert "that has begun" in capsys.readouterr().err


@pytest.mark.parametrize(
    "noted",
    [
        "[" * 9999,
        '{"began": 1e999, "now": 0, "before": 0, "playing": {}}',
        '{"began": 0, "now": 1e308, "before": 0, "playing": {}}',
        '{"began": 0, "now": 9, "before": -1' + "0" * 400 + ', "playing": {}}',
        '{"began": 0, "now": NaN, "before": Infinity, "playing": {"x": 1}}',
        '{"began": 0, "now": ' + "9" * 400 + ', "before": 0, "playing": {}}',
    ],
)
def test_a_note_that_no_clock_can_have_made_is_left_aside(tmp_path: Path, noted: str) -> None:
    store = _begin(tmp_path)
    mark = tmp_path / MARK_NAME
    mark.write_text(mark.read_text().partition("\n")[0] + "\n" + noted)
    seen = Follower(tmp_path).look()
    assert seen.progress.seconds is None
    assert seen.lines(1e9)
    store.close()
