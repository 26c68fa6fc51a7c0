from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_the_preflight_of_a_manifest_is_printed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = ["dev", "preflight", "smoke", "--limit", "2", "--jobs", "1", "--work", str(tmp_path)]
    assert main(arguments) == 0
    assert "2 of 2 cases pass the preflight." in capsys.readouterr().out
