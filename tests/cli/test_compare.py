from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_runs_are_compared(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = ["compare", stored("a", seed=1), stored("b", seed=2), "--json", str(tmp_path / "c.json")]
    assert main(arguments) == 0
    assert "a and b on 64 common" in capsys.readouterr().out
    assert (tmp_path / "c.json").exists()
    assert main([*arguments, "--output", str(tmp_path / "pages")]) == 0
    assert (tmp_path / "pages" / "comparison.html").exists()
