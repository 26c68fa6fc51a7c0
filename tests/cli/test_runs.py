from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_runs_are_listed_with_rates_and_what_is_missing(
    stored: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored("first", seed=1)
    incomplete = Path(stored("checkpoints/second", seed=2)) / "pairs.jsonl"
    incomplete.write_bytes(b"\n".join(incomplete.read_bytes().split(b"\n")[:-3]) + b"\n")
    assert main(["runs", str(tmp_path)]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["run", "policy", "cases"]
    lines = {row.split()[0]: row for row in rows}
    assert lines.keys() == {"first", "checkpoints/second"}
    assert "complete, " in lines["first"]
    assert "%" in lines["first"]
    assert " pp" in lines["first"]
    assert "incomplete, " in lines["checkpoints/second"]
    assert "%" not in lines["checkpoints/second"]


def test_a_run_that_cannot_be_read_is_named_and_the_others_are_listed(
    stored: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored("good", seed=1)
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "pairs.jsonl").write_text("{}\n")
    assert main(["runs", str(tmp_path)]) == 1
    out = capsys.readouterr().out
    assert "good" in out
    assert f"cannot be read: {damaged / 'pairs.jsonl'}, line 1" in out


def test_a_folder_without_runs_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(tmp_path)]) == 0
    assert "no run below" in capsys.readouterr().out
    assert main(["runs", str(tmp_path / "nowhere")]) == 1
    assert "a folder that exists" in capsys.readouterr().err
