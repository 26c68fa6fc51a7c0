"""The lab's command that plays pairs again runs nothing that a published folder names."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from tests.films.conftest import played, played_once, short
from tests.films.test_published_places import evil, witness

__all__ = ["evil", "played", "played_once", "short", "witness"]  # fixtures


def test_no_command_runs_what_a_folder_names(
    evil: Path, witness: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["lab", "demos", "episodes", "--run=."]
    assert main(arguments) == 1
    assert "--cases" in capsys.readouterr().err
    main([*arguments, f"--cases={tmp_path / 'tiny.json'}"])
    assert not witness.exists()
