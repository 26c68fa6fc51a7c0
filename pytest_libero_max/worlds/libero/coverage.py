"""Which sources of cases the installations on this machine play, told from their files alone."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pytest_libero_max.benchmark.cases import SUITE_BUDGETS
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.libero.installation import (
    ASSETS_INSTALL,
    INSTALL,
    NOISE_CURE,
    PLUS_INSTALL,
    Flavour,
    Installation,
    usable,
)
from pytest_libero_max.worlds.libero.pro_config import SECTIONS
from pytest_libero_max.worlds.libero.pro_tasks import has_own_files
from pytest_libero_max.worlds.libero.tasks import task_names, task_of

_TASKS = 10

_PLUS_NAMES = (
    ("Sensor Noise", re.compile(r"_noise_\d+$")),
    ("Language Instructions", re.compile(r"_language_\d+_view_")),
    ("Camera Viewpoints", re.compile(r"_view_(?!0_0_100_0_0_)[\d_]+_initstate_0$")),
    ("Robot Initial States", re.compile(r"_view_0_0_100_0_0_initstate_\d+$")),
    ("Light Conditions", re.compile(r"_light_\d+$")),
    ("Background Textures", re.compile(r"_(?:table|tb)_\d+$")),
    ("Objects Layout", re.compile(r"_(?:add_\d+|(?:moved_)?level\d+_sample\d+)$")),
)
"""LIBERO-Plus's categories by what their tasks' names end with; its package does not list them."""

_ADDED_OBJECTS = re.compile(r"_add_\d+$")
_ARCHIVE = "unpack assets.zip of the data set Sylvest/LIBERO-plus, and name its folder (--libero-assets)"


@dataclass(frozen=True)
class Coverage:
    """How much of a source plays here.

    Attributes:
        source: The source, with the category for LIBERO-PRO and LIBERO-Plus.
        playable: Its tasks that have all they need.
        total: Its tasks; 0 where only its installation could tell.
        missing: What the others lack and what brings it; empty if nothing is missing.
    """

    source: str
    playable: int
    total: int
    missing: str = ""

    def __str__(self) -> str:
        tasks = f"{self.playable} of {self.total} tasks play" if self.total else "does not play"
        return f"{self.source}: {tasks}{f'. {self.missing}' if self.missing else ''}"


def coverage(installations: Sequence[Installation]) -> Iterator[Coverage]:
    """LIBERO, the ten categories of LIBERO-PRO, and the seven of LIBERO-Plus.

    Args:
        installations: What would be played from; may be empty.
    """
    plain = _first(installations, "hf-libero", "LIBERO", "LIBERO-PRO", "LIBERO-Plus")
    pro = _first(installations, "LIBERO-PRO", "hf-libero", "LIBERO", "LIBERO-Plus")
    plus = _first(installations, "LIBERO-Plus")
    yield _libero(plain)
    yield from (_pro(pro, category) for category in SECTIONS)
    yield from _plus(plus)


def _first(installations: Sequence[Installation], *flavours: Flavour) -> Installation | None:
    order = (found for flavour in flavours for found in installations if found.flavour == flavour)
    return next(order, None)


def _libero(found: Installation | None) -> Coverage:
    total = len(SUITE_BUDGETS) * _TASKS
    if found is None:
        return Coverage("LIBERO", 0, total, f"Install it: `{INSTALL}` and `{ASSETS_INSTALL}`")
    playable = sum(_has_task(found, suite, index) for suite in SUITE_BUDGETS for index in range(_TASKS))
    return Coverage("LIBERO", playable, total, "" if playable == total else "Restore its files")


def _has_task(found: Installation, suite: str, index: int) -> bool:
    try:
        task_of(found, suite, index)
    except SubstrateError:
        return False
    return True


def _pro(found: Installation | None, category: str) -> Coverage:
    source, total = f"LIBERO-PRO {category}", len(SUITE_BUDGETS) * _TASKS
    if found is None:
        return Coverage(source, 0, total, f"Install LIBERO-PRO, with its models as above: `{INSTALL}`")
    if category == "object" and found.flavour != "LIBERO-PRO":
        return Coverage(source, 0, total, f"Its objects are in LIBERO-PRO alone: `{INSTALL}`")
    tasks = [(suite, index) for suite in SUITE_BUDGETS for index in range(_TASKS)]
    playable = sum(
        _has_task(found, suite, index) and has_own_files(found, category, suite, index)
        for suite, index in tasks
    )
    return Coverage(source, playable, total, "" if playable == total else f"Its task files: `{INSTALL}`")


def _plus(found: Installation | None) -> Iterator[Coverage]:
    if found is None:
        for category, _ in _PLUS_NAMES:
            yield Coverage(f"LIBERO-Plus {category}", 0, 0, f"Install LIBERO-Plus: `{PLUS_INSTALL}`")
        return
    names = [name for suite in SUITE_BUDGETS for name in task_names(found, suite)]
    total = Counter(_category(name) for name in names)
    added = sum(_ADDED_OBJECTS.search(name) is not None for name in names)
    scenes = found.assets / "scenes"
    lacking: dict[str, tuple[int, str]] = {}
    if not usable("wand.api"):
        motion = sum(1 <= _noise(name) <= 10 for name in names)
        lacking["Sensor Noise"] = motion, f"Motion blur needs Wand: {NOISE_CURE}"
    if next(scenes.rglob("*light*modified*.xml"), None) is None:
        lacking["Light Conditions"] = total["Light Conditions"], f"Its scenes: {_ARCHIVE}"
    if next(scenes.rglob("tabletop_table_*.xml"), None) is None:
        textures = f"Its textures, but for a few floors and walls of libero_object: {_ARCHIVE}"
        lacking["Background Textures"] = total["Background Textures"], textures
    if not (found.assets / "new_objects").is_dir():
        lacking["Objects Layout"] = added, f"Its additional objects: {_ARCHIVE}"
    for category, _ in _PLUS_NAMES:
        number, missing = lacking.get(category, (0, ""))
        yield Coverage(f"LIBERO-Plus {category}", total[category] - number, total[category], missing)


def _category(name: str) -> str | None:
    """The category of a task of LIBERO-Plus; None for one that is not of the registry."""
    return next((category for category, ending in _PLUS_NAMES if ending.search(name)), None)


def _noise(name: str) -> int:
    """The number of a task's noise: ten levels of each kind, motion blur first; 0 where there is none."""
    found = re.search(r"_noise_(\d+)$", name)
    return 0 if found is None else int(found.group(1))
