"""The shell completes commands, options and the names that arguments may have."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("argcomplete", reason="pip install argcomplete")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("libero-max docto", {"doctor"}),
        ("libero-max list prof", {"profiles"}),
        ("libero-max check a.py --pro", {"--profile"}),
        ("libero-max check a.py --profile pi05_lib", {"pi05_libero"}),
        ("libero-max list profiles pi05_lib", {"pi05_libero"}),
        ("libero-max list cases smo", {"smoke"}),
        ("libero-max view resu", {"results/"}),
    ],
)
def test_words_are_completed(tmp_path: Path, typed: str, offered: set[str]) -> None:
    (tmp_path / "results").mkdir()
    answer = tmp_path / "answer"
    environment = {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": typed,
        "COMP_POINT": str(len(typed)),
        "COMP_TYPE": "9",
    }
    subprocess.run(
        [sys.executable, "-c", "from pytest_libero_max.cli import main; main()"],
        cwd=tmp_path,
        env={**os.environ, **environment},
        check=True,
        timeout=120,
    )
    words = {word.strip() for word in answer.read_text().splitlines()}
    assert {word.rstrip("/") for word in offered} <= {word.rstrip("/") for word in words}
