"""Needs of cases that the installations here lack, found from files alone: nothing is built."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.installation import (
    INSTALL,
    NOISE_CURE,
    PLUS_INSTALL,
    Flavour,
    Installation,
    usable,
)
from pytest_libero_max.substrates.libero.plus import plus_task
from pytest_libero_max.substrates.libero.pro_config import check_category
from pytest_libero_max.substrates.libero.pro_tasks import has_own_files, pro_task
from pytest_libero_max.substrates.libero.tasks import task_name, task_of
from pytest_libero_max.substrates.registry import own_variation

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

PLAYED_BY: Mapping[str, tuple[Flavour, ...]] = MappingProxyType(
    {
        "libero": ("hf-libero", "LIBERO", "LIBERO-PRO", "LIBERO-Plus"),
        "pro": ("LIBERO-PRO", "hf-libero", "LIBERO", "LIBERO-Plus"),
        "plus": ("LIBERO-Plus",),
    }
)
"""Installations that can play the cases of a source, the preferred first. LIBERO-Plus comes last for others
than its own: it rounds the camera's pose to four decimals."""

PLUS_NAMES = (
    ("Sensor Noise", re.compile(r"_noise_\d+$")),
    ("Language Instructions", re.compile(r"_language_\d+_view_")),
    ("Camera Viewpoints", re.compile(r"_view_(?!0_0_100_0_0_)[\d_]+_initstate_0$")),
    ("Robot Initial States", re.compile(r"_view_0_0_100_0_0_initstate_\d+$")),
    ("Light Conditions", re.compile(r"_light_\d+$")),
    ("Background Textures", re.compile(r"_(?:table|tb)_\d+$")),
    ("Objects Layout", re.compile(r"_(?:add_\d+|(?:moved_)?level\d+_sample\d+)$")),
)
"""LIBERO-Plus's categories by what their tasks' names end with; its package does not list them."""

OTHER_VARIATIONS = (
    "they name variations that the installed LIBERO-Plus and LIBERO-PRO do not have, as the tracks of the "
    "embedded scenes do; --libero-max-substrate=libero:variations=own plays those of this package's own that "
    "change a scene at reset alone"
)

OTHER_TASKS = (
    "they name tasks of the genuine LIBERO-Plus or LIBERO-PRO, which are played without "
    "--libero-max-substrate=libero:variations=own"
)

_AT_RESET = "--libero-max-substrate=libero:variations=own changes LIBERO's scenes at reset alone"

_ADDED_OBJECTS = re.compile(r"_add_\d+$")
_MOTION_BLUR = range(1, 11)
_ARCHIVE = "unpack assets.zip of the data set Sylvest/LIBERO-plus, and name its folder (--libero-assets)"


def plus_category(name: str) -> str | None:
    """Return the category of a task of LIBERO-Plus; None for one that is not of the registry."""
    return next((category for category, ending in PLUS_NAMES if ending.search(name)), None)


def first_of(installations: Sequence[Installation], source: str) -> Installation | None:
    """Return the installation that plays cases of a source; None if none can."""
    order = (
        installation
        for flavour in PLAYED_BY[source]
        for installation in installations
        if installation.flavour == flavour
    )
    return next(order, None)


@dataclass(frozen=True)
class PlusNeeds:
    """Parts of an installation of LIBERO-Plus that only some of its tasks need."""

    motion_blur: bool
    """True if Wand works."""
    lights: bool
    """True if its scenes with other lights are there."""
    textures: bool
    """True if its tables and walls are there."""
    objects: bool
    """True if its additional objects are there."""

    @classmethod
    def of(cls, installation: Installation) -> PlusNeeds:
        scenes = installation.assets / "scenes"
        return cls(
            motion_blur=usable("wand.api"),
            lights=next(scenes.rglob("*light*modified*.xml"), None) is not None,
            textures=next(scenes.rglob("tabletop_table_*.xml"), None) is not None,
            objects=(installation.assets / "new_objects").is_dir(),
        )

    def lacking(self, name: str) -> str:
        """Return the needs of the task of this name that are not there, in words; empty for none."""
        category = plus_category(name)
        if category == "Sensor Noise" and _noise(name) in _MOTION_BLUR and not self.motion_blur:
            return f"Motion blur needs Wand: {NOISE_CURE}"
        if category == "Light Conditions" and not self.lights:
            return f"Its scenes: {_ARCHIVE}"
        if category == "Background Textures" and not self.textures:
            return f"Its textures, but for a few floors and walls of libero_object: {_ARCHIVE}"
        if _ADDED_OBJECTS.search(name) and not self.objects:
            return f"Its additional objects: {_ARCHIVE}"
        return ""


def pro_lacks(installation: Installation, category: str, suite: str, index: int) -> str:
    """Return the needs of a task of LIBERO-PRO that are not there, in words; empty for none."""
    if category == "object" and installation.flavour != "LIBERO-PRO":
        return f"Its objects are in LIBERO-PRO alone: `{INSTALL}`"
    return "" if has_own_files(installation, category, suite, index) else f"Its task files: `{INSTALL}`"


def lacking(installations: Sequence[Installation], cases: Iterable[Case]) -> dict[str, str]:
    """Return the reasons why cases cannot play here, by id, the same words for the same reason.

    Reasons that show only when a scene is built (an initial state that cannot be varied, a damaged file) are
    not looked for, so others may still not play.
    """
    plus = first_of(installations, "plus")
    needs = None if plus is None else PlusNeeds.of(plus)
    reasons = {case.case_id: _reason(case, first_of(installations, case.source), needs) for case in cases}
    return {case_id: reason for case_id, reason in reasons.items() if reason}


def lacking_own(cases: Iterable[Case]) -> dict[str, str]:
    """Return the reasons why cases cannot play with the source variations of this package's own, by id."""
    reasons = {case.case_id: _reason_of_own(case) for case in cases if case.source != "libero"}
    return {case_id: reason for case_id, reason in reasons.items() if reason}


def _reason_of_own(case: Case) -> str:
    try:
        variation = own_variation(case)
    except SubstrateError:
        return OTHER_TASKS
    if not variation.scene:
        return ""
    return f"{case.source_category}. They need scenes of their own, and {_AT_RESET}"


def _reason(case: Case, installation: Installation | None, needs: PlusNeeds | None) -> str:
    if installation is None:
        return f"LIBERO-Plus is not installed: `{PLUS_INSTALL}`"
    named = case.record.get("task_name")
    try:
        if case.source == "plus":
            assert needs is not None
            name = plus_task(installation, case.suite, case.task_index, named).name
            what = needs.lacking(name)
            return f"{plus_category(name)}. {what}" if what else ""
        if case.source == "libero":
            task_of(installation, case.suite, case.task_index)
            return ""
        check_category(case.source_category)
        if named not in (None, task_name(installation, case.suite, case.task_index)):
            return OTHER_VARIATIONS
        what = pro_lacks(installation, case.source_category, case.suite, case.task_index)
        if not what:
            pro_task(installation, case)
            return ""
    except SubstrateError as error:
        return OTHER_VARIATIONS if case.source == "plus" else str(error)
    return f"{case.source_category}. {what}"


def _noise(name: str) -> int:
    """Return the number of a task's noise: ten levels of each kind, motion blur first; 0 for none."""
    match = re.search(r"_noise_(\d+)$", name)
    return 0 if match is None else int(match.group(1))
