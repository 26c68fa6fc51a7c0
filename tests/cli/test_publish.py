from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main


def test_a_run_is_published(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["publish", "pack", stored("run", seed=1), str(tmp_path / "published" / "run")]) == 0
    assert "pairs.jsonl.gz" in capsys.readouterr().out
    assert main(["report", str(tmp_path / "published" / "run")]) == 0


def test_the_published_policies_say_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "published"]) == 0
    out = capsys.readouterr().out
    assert "Published results on" in out
    assert len(out.splitlines()) == 4 + 14
