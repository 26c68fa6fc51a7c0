from __future__ import annotations

import subprocess
import sys
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from pytest_libero_max.runs.provenance import collect, git_state, package_versions, redacted


@pytest.mark.parametrize(
    ("command", "cleaned"),
    [
        (["pytest", "-n", "2"], ["pytest", "-n", "2"]),
        (["pytest", "--hub-token", "abc"], ["pytest", "--hub-token", "***"]),
        (["pytest", "--api-key=abc", "-q"], ["pytest", "--api-key=***", "-q"]),
        (["pytest", "--policy=tcp://me:word@host:1"], ["pytest", "--policy=tcp://***@host:1"]),
        (["pytest", "http://host/?a=1&token=abc&b=2"], ["pytest", "http://host/?a=1&token=***&b=2"]),
        (["/home/ann/bin/pytest", "--out=/home/ann/x"], ["~/bin/pytest", "--out=~/x"]),
    ],
)
def test_a_command_line_is_fit_to_be_published(command: list[str], cleaned: list[str]) -> None:
    assert redacted(command, {"HOME": "/home/ann"}) == cleaned


def test_without_a_home_folder_nothing_is_replaced() -> None:
    assert redacted(["/bin/pytest"], {"HOME": "/"}) == ["/bin/pytest"]
    assert redacted(["/bin/pytest"], {}) == ["/bin/pytest"]


def test_versions_of_what_is_installed_and_of_what_is_not() -> None:
    assert package_versions(["pytest", "no-such-distribution"]) == {
        "pytest": pytest.__version__,
        "no-such-distribution": None,
    }


def test_the_git_state_is_commit_and_dirt(tmp_path: Path) -> None:
    assert git_state(tmp_path) is None
    user = ["-c", "user.name=a", "-c", "user.email=a@b"]
    for arguments in (["init", "-q"], [*user, "commit", "-q", "--allow-empty", "-m", "first"]):
        subprocess.run(["git", *arguments], cwd=tmp_path, check=True)
    clean = git_state(tmp_path)
    assert clean is not None
    assert len(clean["commit"]) == 40
    assert clean["dirty"] is False
    (tmp_path / "file").write_text("")
    assert git_state(tmp_path) == {**clean, "dirty": True}


def test_collecting_imports_no_simulator() -> None:
    code = (
        "import sys; from pytest_libero_max.runs import plan, provenance, store;"
        "provenance.collect(policy={'reference': 'a.py'}, substrate={'name': 'embedded'}, scores={},"
        " case_set={}, protocol={}, command=[]);"
        "heavy = {'mujoco', 'robosuite', 'numpy', 'scipy', 'numba', 'cv2'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_provenance_names_the_whole_origin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("HOME", "/home/ann")
    origin = collect(
        policy={"reference": "/home/ann/a.py", "horizon": None},
        substrate={"name": "embedded"},
        scores={"comparable_with_published": False, "note": "Not comparable."},
        case_set={"name": "track smoke", "digest": "ab"},
        protocol={"prefix": "fork"},
        command=["pytest"],
        started=datetime(2026, 5, 1, 14, 30, tzinfo=timezone(timedelta(hours=2))),
        folder=tmp_path,
    )
    assert set(origin) == {
        "started",
        "versions",
        "platform",
        "gl_backend",
        "git",
        "substrate",
        "scores",
        "case_set",
        "order",
        "policy",
        "protocol",
        "command",
    }
    assert origin["started"] == "2026-05-01T12:30:00+00:00"
    assert origin["gl_backend"] == "egl"
    assert {"system", "machine", "libc", "processor", "cores"} == set(origin["platform"])
    assert origin["platform"]["cores"] >= 1
    assert origin["policy"] == {"reference": "~/a.py", "horizon": None}
    assert origin["versions"]["scipy"] is not None
