from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_an_interrupted_build_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pytest_libero_max.makers.construction.examiner.Examiner", interrupt)
    assert main(["dev", "build", str(tmp_path), "--work", "here"]) == 130
    assert "kept in here" in capsys.readouterr().err


def test_a_draw_is_bound_first(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder, work = tmp_path / "2027Q1", tmp_path / "work"
    arguments = ["dev", "build", "--draw", "2027Q1", "--work", str(work), str(folder)]
    assert main([*arguments, "--commit"]) == 0
    digest = (folder / "SEED.sha256").read_text().split()[0]
    assert capsys.readouterr().out.startswith(f"{digest}\nPublish {folder}")
    assert (work / "2027Q1.seed").read_text().startswith("2027Q1 ")
    for more, said in (
        (["--commit"], "has a seed already"),
        (["smoke", "lite"], "a draw is of one track"),
        (["--substrate", "libero"], "A fresh draw is made on embedded scenes"),
    ):
        assert main([*arguments, *more]) != 0
        assert said in capsys.readouterr().err
    assert main(["dev", "build", str(tmp_path / "other"), "--draw", "2027Q1"]) != 0
    assert "must be called '2027Q1'" in capsys.readouterr().err
    assert main(["dev", "build", str(folder), "--commit"]) != 0
    assert "Add --draw NAME" in capsys.readouterr().err
