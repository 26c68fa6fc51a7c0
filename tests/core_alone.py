"""A copy of this repository without the lab: ``python -m tests.core_alone [ARGUMENT OF PYTEST ...]``.

It plays the tests of everything else there, which have to pass as they do here. ``.ci/run`` plays the quick
ones of ``tests/cli`` and ``tests/runs``; before a release play them all.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
OF_ALL = (
    *("tests/lab", "tests/reference", "tests/scripts"),
    *(f"tests/test_{name}.py" for name in ("documented_commands", "documents", "rooms", "run_figures")),
)
"""Tests of the lab, and of pages and programs that are about the package with the lab."""

_NOT_EDITABLE = """import sys

sys.meta_path[:] = [
    finder for finder in sys.meta_path if not getattr(finder, "__module__", "").startswith("__editable__")
]
"""
"""Python begins with it: the finder of an editable installation would find the rooms that were left out."""

_COPIED = ("pytest_libero_max", "tests")


def copy_without(folder: Path, left_out: Iterable[str] = ("lab",)) -> dict[str, str]:
    """Copy the repository without some rooms and their entry points.

    Args:
        folder: An empty folder.
        left_out: Rooms of the package.

    Returns:
        The environment in which the copy is the installed package.
    """
    rooms = {*left_out}

    def lacking(place: str, names: list[str]) -> set[str]:
        return rooms & {*names} if Path(place).parent == ROOT else set()

    for path in ROOT.iterdir():
        if path.name in _COPIED:
            shutil.copytree(path, folder / path.name, ignore=lacking)
        elif path.name == "pyproject.toml":
            (folder / path.name).write_text(
                _without(path.read_text(encoding="utf-8"), rooms), encoding="utf-8"
            )
        elif not path.name.startswith("."):
            (folder / path.name).symlink_to(path)
    _install(folder)
    (folder / "sitecustomize.py").write_text(_NOT_EDITABLE)
    return {**os.environ, "PYTHONPATH": str(folder)}


def _without(project: str, rooms: Iterable[str]) -> str:
    """Return a ``pyproject.toml`` without the entry points of some rooms."""
    points = rf'^[\w."-]+ = "pytest_libero_max\.(?:{"|".join(rooms)})\b.*"\n'
    return re.sub(points, "", project, flags=re.MULTILINE)


def _install(folder: Path) -> None:
    """Write what an installer writes, which comes before that of the installed package."""
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"console_scripts": project["scripts"], **project["entry-points"]}
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    (info / "entry_points.txt").write_text(
        "\n".join(
            line
            for group, points in groups.items()
            for line in (f"[{group}]", *(f"{name} = {value}" for name, value in points.items()))
        )
    )


def main(arguments: list[str]) -> int:
    """Play tests in a copy; returns the exit status of pytest."""
    with tempfile.TemporaryDirectory() as folder:
        environment = copy_without(Path(folder))
        others = (f"--ignore={path}" for path in OF_ALL)
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *others, *arguments]
        return subprocess.run(command, cwd=folder, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
