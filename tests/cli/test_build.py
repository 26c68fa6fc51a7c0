from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_an_interrupted_build_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pytest_libero_max.construction.examiner.Examiner", interrupt)
    assert main(["build", str(tmp_path), "--work", "here"]) == 130
    assert capsys.readouterr().err == (
        "libero-max: interrupted. What was examined is kept in here: give the same command again to go on.\n"
    )
