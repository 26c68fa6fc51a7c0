"""Packages of strangers in the tests: installed for a session of pytester, as pip would install them."""

from __future__ import annotations

import os
import shutil
import tomllib
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]


def install(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, package: Path) -> None:
    """Put the modules of a package into the folder of a session, with what names its entry points."""
    pyproject = tomllib.loads((package / "pyproject.toml").read_text())
    project, modules = pyproject["project"], pyproject["tool"]["setuptools"]["py-modules"]
    distribution = project["name"].replace("-", "_")
    info = pytester.mkdir(f"{distribution}-{project['version']}.dist-info")
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n")
    groups = (
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in points.items())])
        for group, points in project["entry-points"].items()
    )
    (info / "entry_points.txt").write_text("\n".join(groups))
    for module in modules:
        shutil.copy(package / f"{module}.py", pytester.path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(pytester.path), str(REPOSITORY)]))
