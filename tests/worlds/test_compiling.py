from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.worlds.rendering import gl

LOOP = """
def loop(number):
    return number + 1
"""
COMPILE = """
import loops
from pytest_libero_max.worlds.compiling import compiled
function = compiled(loops.loop)
assert function(1) == 2
print(function.stats.cache_path)
"""


@pytest.mark.parametrize("named", ["", "here"])
def test_loops_are_kept_in_the_users_cache_and_never_in_the_current_folder(
    named: str, tmp_path: Path
) -> None:
    """The module's own folder cannot hold them: a file has the name of its cache."""
    package, here, home = (tmp_path / name for name in ("package", "here", "home"))
    for folder in (package, here, home):
        folder.mkdir()
    (package / "loops.py").write_text(LOOP)
    (package / "__pycache__").write_text("no folder")
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", COMPILE],
        env=kept | {"XDG_CACHE_HOME": named, "HOME": str(home), "PYTHONPATH": str(package)},
        cwd=here,
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).is_relative_to(home / ".cache/numba")
    assert not [*here.iterdir()]


def test_robosuite_is_imported_where_numba_finds_the_users_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(importlib, "import_module", lambda name: seen.append(os.environ["XDG_CACHE_HOME"]))
    gl.import_robosuite()
    assert seen == [str(tmp_path / ".cache")]
