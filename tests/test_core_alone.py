"""Without the lab and the makers, everything else plays, reports and prints its help."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

from tests.core_alone import copy_without
from tests.plugin.conftest import REACHER, tiny_manifest


def test_a_pair_is_played_and_reported_without_lab_and_makers(tmp_path: Path) -> None:
    copy, here = tmp_path / "copy", tmp_path / "here"
    copy.mkdir()
    here.mkdir()
    environment = copy_without(copy, ("lab", "makers"))
    (here / "adapter.py").write_text(REACHER)
    (here / "tiny.json").write_text(json.dumps(tiny_manifest(events=("camera_shift",))))
    (here / "conftest.py").write_text(
        "import pytest_libero_max, sys\n"
        "def pytest_sessionfinish():\n"
        f"    assert pytest_libero_max.__file__.startswith({str(copy)!r})\n"
    )

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, *words], cwd=here, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run(
        "-m",
        "pytest",
        "--libero-max-policy=adapter.py",
        "--libero-max-substrate=tiny",
        "--libero-max-manifest=tiny.json",
        "--libero-max-limit=1",
    )
    command = ("-m", "pytest_libero_max.cli")
    run(*command, "report", "libero-max-results")
    report = json.loads((here / "libero-max-results" / "report.json").read_text())
    assert report["pairs"]["played"] == 1
    assert [*report["sections"]] == ["How long it took"]  # of the core; every other one is of the lab
    shown = "".join(
        (here / "libero-max-results" / name).read_text(encoding="utf-8")
        for name in ("report.md", "report.html")
    )
    assert not re.search("[Ss]ham event|Audit of inputs|but unsafe|Repeats with|Monitor ", shown)
    listed = run(*command, "--help")
    assert re.search("^  gate ", listed, re.MULTILINE)
    assert not re.search("^  (lab|dev) ", listed, re.MULTILINE)
