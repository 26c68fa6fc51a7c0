from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_a_report_is_recomputed_from_the_pairs_alone(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = stored("run", seed=1)
    assert main(["report", folder, "--figures", "--tables", "--gate=planned > 64"]) == 0
    assert "<b class='violated'>violated</b>" in Path(folder, "report.html").read_text()
    assert "64 of 64 planned pairs" in capsys.readouterr().out
    names = {path.name for path in Path(folder).iterdir()}
    assert {"report.json", "report.md", "report.html", "report.csv", "report.tex"} <= names
    assert {"base-to-dynamic.svg", "base-to-dynamic.png"} <= names
