"""The tasks of LIBERO-PRO: where its files are, and LIBERO's own scene where it needs none.

Its data set goes into the installation's folders of task descriptions and initial states; a case names its
files in there. Five categories change LIBERO's scene after the reset and can do without; so can the wording,
which the case holds, and the occlusion, which adds one object to the scene in the same way for every task.
"""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.installation import INSTALL, Installation
from pytest_libero_max.substrates.libero.pro_config import Config, check_category, occluder, read_config
from pytest_libero_max.substrates.libero.tasks import (
    Task,
    check_name,
    states_file,
    task_name,
    task_of,
    words_of,
)

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

DATA_SET = "zhouxueyang/LIBERO-Pro"

_FOLDERS = MappingProxyType(
    {
        "semantic": "{suite}_lan",
        "object": "{suite}_object",
        "position": "{suite}_swap",
        "task": "{suite}_task",
        "visual_noise_glare": "01_visual_noise_glare/bddl/{suite}",
        "camera_view_angle": "02_camera_view_angle/bddl/{suite}",
        "object_texture": "04_object_texture/bddl/{suite}",
        "view_occlusion": "05_view_occlusion/bddl/{suite}",
        "object_shape": "06_object_shape/bddl/{suite}",
        "initial_pose_position_angle": "07_initial_pose_position_angle/bddl/{suite}",
    }
)
_OWN_STATES = ("semantic", "object", "position", "task")
_OWN_SCENES = ("object", "position", "task")

_SECTION = re.compile(r"\(:(\w+)|[()]")
_REGION = "perturb_occ_bottle_1_init_region"


@dataclass(frozen=True)
class ProTask(Task):
    """A task as LIBERO-PRO varies it."""

    category: str
    """One of :data:`.pro_config.SECTIONS`."""
    reference: Path
    """The BDDL file whose joints the initial states hold."""
    config: Config | None
    """Sections that the task's file switches on; None where the scene is LIBERO's own."""

    @property
    def language(self) -> str:
        return words_of(self.bddl) if self.config is not None else super().language

    @property
    def source(self) -> str:
        own = self.config is not None or self.category == "view_occlusion"
        return f"-pro/{self.category}" if own else super().source

    @contextlib.contextmanager
    def description(self) -> Iterator[Path]:
        if self.config is not None or self.category != "view_occlusion":
            yield self.bddl
            return
        with tempfile.TemporaryDirectory(prefix="libero-max-") as folder:
            path = Path(folder, self.bddl.name)
            path.write_text(with_occluder(self.bddl.read_text(encoding="utf-8")), encoding="utf-8")
            yield path


def pro_task(installation: Installation, case: Case) -> ProTask:
    """Return the task that a case of LIBERO-PRO plays, or raise SubstrateError.

    Args:
        installation: Any; its folders may or may not hold the data set's files.
        case: Its ``substrate_variant`` names the files; without one they are looked for where the data set
            has them.
    """
    category = case.source_category
    check_category(category)
    own = task_of(installation, case.suite, case.task_index)
    check_name(installation, own, case.record.get("task_name"))
    names = _files(case, own.name)
    bddl = _inside(installation.bddl, names["bddl_file"])
    states = states_file(_inside(installation.states, names["init_states_file"]))
    reference = _inside(installation.bddl, names["init_reference_bddl_file"])
    if bddl.is_file():
        _require(installation, category, states)
        return ProTask(
            case.suite,
            case.task_index,
            own.name,
            bddl,
            states,
            category,
            reference if reference.is_file() else own.bddl,
            read_config(bddl, category),
        )
    if category in _OWN_SCENES or (category == "semantic" and case.instruction is None):
        _require(installation, category, bddl)
    return ProTask(
        case.suite, case.task_index, own.name, own.bddl, own.states, category, own.bddl, config=None
    )


def has_own_files(installation: Installation, category: str, suite: str, index: int) -> bool:
    """Return True if a task of LIBERO-PRO has the files that its category cannot do without."""
    if category not in _OWN_STATES:
        return True
    names = places(category, suite, task_name(installation, suite, index))
    states = states_file(installation.states / names["init_states_file"])
    return (installation.bddl / names["bddl_file"]).is_file() and states.is_file()


def _files(case: Case, name: str) -> dict[str, str]:
    """Paths of the task's files in the folders of descriptions and of states."""
    named = case.record.get("substrate_variant") or {}
    where = places(case.source_category, case.suite, name)
    return {key: str(named.get(key, path)) for key, path in where.items()}


def places(category: str, suite: str, name: str) -> dict[str, str]:
    """Paths of the files in LIBERO-PRO's data set."""
    folder = _FOLDERS[category].format(suite=suite)
    own_states = category in _OWN_STATES
    return {
        "bddl_file": f"{folder}/{name}.bddl",
        "init_states_file": f"{folder if own_states else suite}/{name}.pruned_init",
        "init_reference_bddl_file": f"{folder if own_states else f'{suite}_lan'}/{name}.bddl",
    }


def _inside(folder: Path, name: str) -> Path:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or not path.parts:
        raise SubstrateError(
            f"substrate_variant names the file {name!r}, but a case may only name files below the "
            "installation's folders. Do not play this manifest unless you know why it does."
        )
    return folder / path


def _require(installation: Installation, category: str, path: Path) -> None:
    if not path.is_file():
        raise SubstrateError(
            f"{installation} lacks {str(path)!r}, which LIBERO-PRO's {category!r} is played from. Install "
            f"LIBERO-PRO (`{INSTALL}`), or put bddl_files and init_files of its data set {DATA_SET} into the "
            "folders of those names of a LIBERO-PRO that you name (pytest --libero-max-libero, libero-max "
            "--libero)."
        )


def with_occluder(text: str) -> str:
    """Return a BDDL text with the object that LIBERO-PRO hides the target behind, as its own files add it."""
    surface = re.search(r"\(:fixtures\s.*?(\S+)\s+-\s+\S*(?:table|floor)(?=[\s)])", text, re.DOTALL)
    if surface is None:
        raise SubstrateError("The task's BDDL file has no table and no floor. Restore it from the package.")
    name, category = occluder((surface.group(1),))
    region = (
        f"({_REGION} (:target {surface.group(1)}) (:ranges ((-0.34 -0.3 -0.33 -0.29))) "
        "(:yaw_rotation ((0.0 0.0))))"
    )
    text = _appended(text, "regions", region)
    text = _appended(text, "objects", f"{name} - {category}")
    return _appended(text, "init", f"(On {name} {surface.group(1)}_{_REGION})")


def _appended(text: str, section: str, addition: str) -> str:
    """Put something at the end of a section."""
    depth = 0
    for section_match in _SECTION.finditer(text, text.index(f"(:{section}")):
        depth += -1 if section_match.group() == ")" else 1
        if depth == 0:
            return f"{text[: section_match.start()]}  {addition}\n  {text[section_match.start() :]}"
    raise SubstrateError(f"(:{section} of the task's BDDL file is not closed. Restore it from the package.")
