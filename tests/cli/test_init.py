from __future__ import annotations

import sys
from pathlib import Path

import pytest
import yaml

from pytest_libero_max.cli import main
from pytest_libero_max.cli.init import ADAPTER, GATES, INI, WORKFLOW, has_stand_in
from pytest_libero_max.report.gates import parse_gates
from tests.warm_processes import SUBPROCESS

FILES = (ADAPTER, INI, WORKFLOW)


def test_a_new_folder_gets_three_files_and_the_next_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "new"]) == 0
    printed = capsys.readouterr().out
    assert all((tmp_path / "new" / name).is_file() for name in FILES)
    assert "cd new\n  libero-max check adapter.py" in printed
    assert "pytest libero-max" in printed
    workflow = yaml.safe_load((tmp_path / "new" / WORKFLOW).read_text())
    assert workflow["jobs"]["pairs"]["steps"][-1]["with"]["policy"] == ADAPTER
    assert len(parse_gates(GATES)) == len(GATES)
    assert {gate.name for gate in parse_gates(GATES)} == {"base_sr", "trigger_coverage", "delta"}
    assert has_stand_in((tmp_path / "new" / ADAPTER).read_text())


def test_nothing_is_overwritten_and_the_rest_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / ADAPTER).write_text("mine")
    assert main(["init"]) == 0
    assert (tmp_path / ADAPTER).read_text() == "mine"
    before = {name: (tmp_path / name).read_bytes() for name in FILES}
    capsys.readouterr()
    assert main(["init", "."]) == 0
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == before
    assert sum(line.startswith("kept ") for line in capsys.readouterr().out.splitlines()) == 3


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("pyproject.toml", '[tool.pytest.ini_options]\naddopts = "-q"\n', 'libero_max_policy = "adapter.py"'),
        ("tox.ini", "[pytest]\naddopts = -q\n", "libero_max_policy = adapter.py"),
    ],
)
def test_settings_of_pytest_are_added_by_hand_where_a_file_has_some(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, line: str
) -> None:
    (tmp_path / name).write_text(text)
    assert main(["init", str(tmp_path)]) == 0
    assert not (tmp_path / INI).exists()  # it would hide them
    assert (tmp_path / name).read_text() == text
    assert line in capsys.readouterr().out


def test_a_folder_below_the_root_of_a_repository_is_told_where_workflows_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / ".git").mkdir()
    main(["init", str(tmp_path / "robots")])
    assert "robots/adapter.py" in capsys.readouterr().out
    main(["init", str(tmp_path)])
    assert "GitHub" not in capsys.readouterr().out


def test_pytest_collects_the_pairs_of_what_was_written(tmp_path: Path) -> None:
    main(["init", str(tmp_path)])
    chosen = ("-k", "pro-object", "--libero-max-limit=4", "--collect-only", "-q")
    done = SUBPROCESS.run(
        [sys.executable, "-m", "pytest", "libero-max", *chosen], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout
    assert "libero-max::test_pair[" in done.stdout
