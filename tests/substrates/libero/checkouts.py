"""Small checkouts of LIBERO-Plus and LIBERO-PRO, made of the installed package's own sources and files."""

from __future__ import annotations

import shutil
from pathlib import Path

from pytest_libero_max.substrates.libero.installation import Installation, find_installation
from pytest_libero_max.substrates.libero.tasks import task_of
from tests.substrates.libero.data import DATA

SUITE = "libero_object"


def plus_checkout(installation: Installation, root: Path) -> Installation:
    """A LIBERO-Plus with two variations of ``libero_object/0``: LIBERO's scene, and one without its model."""
    task = task_of(installation, SUITE, 0)
    package = _package(installation, root)
    names = [f"{task.name}_table_1", f"{task.name}_light_2"]
    text = task.bddl.read_text()
    _write(package / "benchmark" / "task_classification.json", "{}")
    _write(package / "benchmark" / "libero_suite_task_map.py", f"libero_task_map = {{{SUITE!r}: {names!r}}}")
    _write(package / "bddl_files" / SUITE / f"{names[0]}.bddl", text)
    # Where LIBERO-Plus's own problem class would name a scene that is not there, an object does it here.
    _write(package / "bddl_files" / SUITE / f"{names[1]}.bddl", text.replace("milk", "yellow_book"))
    _link_states(installation, package)
    return find_installation(root, assets=DATA / "assets")


def pro_checkout(installation: Installation, root: Path) -> Installation:
    """A LIBERO-PRO with the files of one task of its category ``task``."""
    task = task_of(installation, SUITE, 0)
    package = _package(installation, root)
    _write(root / "libero_ood" / "ood_task.yaml", "")
    shutil.copy(installation.package / "benchmark" / "libero_suite_task_map.py", package / "benchmark")
    goal = task.bddl.read_text().replace("(In alphabet_soup_1 basket", "(In milk_1 basket")
    _write(package / "bddl_files" / f"{SUITE}_task" / task.bddl.name, goal)
    (package / "bddl_files" / SUITE).symlink_to(task.bddl.parent)
    _link_states(installation, package)
    (package / "init_files" / f"{SUITE}_task").symlink_to(task.states.parent)
    return find_installation(root, assets=DATA / "assets")


def _package(installation: Installation, root: Path) -> Path:
    package = root / "libero" / "libero"
    (package / "benchmark").mkdir(parents=True)
    (package / "bddl_files").mkdir()
    shutil.copy(installation.package / "__init__.py", package)
    for folder in ("envs", "utils"):
        shutil.copytree(
            installation.package / folder, package / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    return package


def _link_states(installation: Installation, package: Path) -> None:
    (package / "init_files").mkdir()
    (package / "init_files" / SUITE).symlink_to(installation.states / SUITE)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
