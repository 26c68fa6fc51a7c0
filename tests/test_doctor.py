from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.doctor import _compiled, diagnose
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.libero import installation
from pytest_libero_max.worlds.compiling import kept_in
from pytest_libero_max.worlds.versions import version_notes
from tests.substrates.libero.test_installation import checkout


def test_a_complete_installation_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "importable", lambda name: True)
    texts = [str(finding) for finding in diagnose(SubstrateOptions((checkout(tmp_path),)))]
    assert any(text.startswith("ok") and "LIBERO unknown" in text for text in texts)
    assert not [text for text in texts if text.startswith("missing") and "images" not in text]


def test_missing_modules_come_with_their_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "importable", lambda name: False)
    texts = [str(finding) for finding in diagnose(SubstrateOptions((checkout(tmp_path),)))]
    assert any(text.endswith("bddl: `pip install --no-deps bddl==1.0.1`") for text in texts)
    assert any("easydict" in text and "install easydict future" in text for text in texts)


def test_the_command_fails_where_something_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor", "--libero", str(tmp_path)]) == 1
    shown = capsys.readouterr()
    assert "holds no LIBERO" in shown.out
    assert "Missing: " in shown.err


def test_a_machine_without_a_libero_is_healthy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent(*arguments: object, **options: object) -> tuple[()]:
        raise SubstrateError("No LIBERO is installed.")

    monkeypatch.setattr(installation, "find_installations", absent)
    main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok      pytest-libero-max ")
    assert f"Python {sys.version_info.major}.{sys.version_info.minor}" in lines[0]
    assert [line for line in lines if "LIBERO is" in line] == ["note    No LIBERO is installed."]


def test_the_folder_of_compiled_loops_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numba

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert [str(one) for one in _compiled()] == [f"ok      loops are compiled once and kept in {kept_in()}"]
    assert str(kept_in()).startswith(str(tmp_path))
    njit = numba.njit

    def cannot_write(*functions: Any, cache: bool = False) -> Any:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(*functions)

    monkeypatch.setattr(numba, "njit", cannot_write)
    assert kept_in() is None
    assert ["note" in str(one) and "NUMBA_CACHE_DIR" in str(one) for one in _compiled()] == [True]


@pytest.mark.parametrize(
    ("mujoco", "robosuite", "words"),
    [
        ("3.2.6", "1.4.1", ["warm start"]),
        ("3.3.6", "1.4.0", []),
        ("3.3.7", "1.4.1", []),
        ("3.4.0", "1.4.0", ["contacts of boxes"]),
        ("3.8.1", "1.5.0", ["contacts of boxes", "robosuite 1.5.0"]),
    ],
)
def test_known_differences_of_versions_are_named(mujoco: str, robosuite: str, words: list[str]) -> None:
    notes = version_notes(mujoco, robosuite)
    assert len(notes) == len(words)
    for note, word in zip(notes, words, strict=True):
        assert word in note
