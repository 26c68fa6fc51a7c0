"""Checks of a machine for each substrate, with the commands that mend them."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pytest_libero_max.errors import LiberoMaxError, SubstrateError, counted
from pytest_libero_max.machine import GIB, available_bytes, free_disk_bytes, memory_bytes
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import DEFAULT, SUBSTRATES
from pytest_libero_max.worlds.rendering import egl, gl
from pytest_libero_max.worlds.rendering.context import drawn_by, fingerprint
from pytest_libero_max.worlds.versions import PICTURES, version_notes

if TYPE_CHECKING:
    from pytest_libero_max.substrates.libero.installation import Installation

MAX_RUN_BYTES = 120 * 2**20
"""Records and reports of 8,000 pairs, without traces and films."""

Level = Literal["ok", "note", "missing"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    level: Level
    text: str

    def __str__(self) -> str:
        return f"{self.level:<8}{self.text}"


def diagnose(options: SubstrateOptions | None = None) -> list[Finding]:
    """Look at packages, rendering, memory, disk and genuine installations. Nothing of LIBERO is imported."""
    options = options or SubstrateOptions()
    return [*_packages(), *_rendering(), *_compiled(), *_resources(), *_installations(options)]


def _packages() -> Iterator[Finding]:
    yield Finding(
        "ok", f"pytest-libero-max {version('pytest-libero-max')}, Python {platform.python_version()}"
    )
    found: dict[str, str] = {}
    for package in ("mujoco", "robosuite", "numpy", "numba", "scipy", "opencv-python-headless"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            yield Finding("missing", f"{package}: reinstall with `pip install pytest-libero-max`")
    if found:
        yield Finding("ok", ", ".join(f"{name} {number}" for name, number in found.items()))
    if {"mujoco", "robosuite"} <= found.keys():
        notes = [*version_notes(found["mujoco"], found["robosuite"]), PICTURES]
        yield from (Finding("note", text) for text in notes)


def _rendering() -> Iterator[Finding]:
    try:
        gl.check()
        backend = gl.require()
        where = " on {}, of {}".format(*egl.chosen()) if backend == "egl" else ""
        from pytest_libero_max.worlds.rendering.renderer import require_images

        require_images()
        yield Finding("ok", f"images with {gl.VARIABLE}={backend}{where}")
        yield Finding("ok", f"images are drawn by {drawn_by(fingerprint(images=True))}")
    except ImportError:
        return  # MuJoCo is missing, which has been said
    except LiberoMaxError as error:
        yield Finding("missing", f"images: {error}")


def _compiled() -> Iterator[Finding]:
    try:
        from pytest_libero_max.worlds.compiling import kept_in
    except ImportError:
        return  # Numba is missing, which has been said
    folder = kept_in()
    if folder is not None:
        yield Finding("ok", f"loops are compiled once and kept in {folder}")
    else:
        cure = "name a folder that can be written with NUMBA_CACHE_DIR"
        yield Finding("note", f"every process compiles its loops, 5 to 10 s: {cure}")


def _resources() -> Iterator[Finding]:
    processors, available = len(os.sched_getaffinity(0)), available_bytes()
    if available is not None:
        each = SUBSTRATES[DEFAULT].worker_gib
        fits = int(available / (each * GIB))
        text = (
            f"{counted(processors, 'processor')}, {available / GIB:.1f} of {memory_bytes() / GIB:.1f} GiB "
            "memory free: "
            f"-n {max(min(processors, fits), 1)} on the {DEFAULT} substrate, where each worker takes "
            f"{each:.1f} GiB and the policy"
        )
        yield Finding("ok" if fits >= processors else "note", text)
    free = free_disk_bytes(Path())
    if free is not None:
        text = f"{free / GIB:.1f} GiB of disk free here; a run of max takes {MAX_RUN_BYTES / GIB:.1f}"
        cure = "; make room, or write elsewhere with --libero-max-output"
        yield Finding("ok", text) if free >= MAX_RUN_BYTES else Finding("note", text + cure)


def _installations(options: SubstrateOptions) -> Iterator[Finding]:
    # Not at the top: a plain `libero-max` command has no use for it.
    from pytest_libero_max.substrates.libero.coverage import coverage
    from pytest_libero_max.substrates.libero.installation import find_installations

    try:
        found = find_installations(options.installations, assets=options.assets)
    except SubstrateError as error:
        asked = options.installations or options.assets
        yield Finding("missing" if asked else "note", str(error))
        return
    for one in found:
        yield from _installation(one)
    for source in coverage(found):
        yield Finding("note" if source.missing else "ok", str(source))


def _installation(found: Installation) -> Iterator[Finding]:
    from pytest_libero_max.substrates.libero.installation import (
        BDDL_INSTALL,
        REQUIREMENTS_INSTALL,
        missing_requirements,
    )

    yield Finding("ok", f"{found} in {found.root}")
    folders = f"its assets in {found.assets}, tasks in {found.bddl}, initial states in {found.states}"
    yield Finding("ok", folders)
    missing = missing_requirements(found.module)
    if "bddl" in missing:
        yield Finding("missing", f"module bddl: `{BDDL_INSTALL}`")
    others = [name for name in missing if name != "bddl"]
    if others:
        yield Finding("missing", f"modules {', '.join(others)}: `{REQUIREMENTS_INSTALL}`")
