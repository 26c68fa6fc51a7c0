"""The genuine substrate: one installation, one world for each task and seed, built on first use."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds import gl
from pytest_libero_max.worlds.contract import Semantics
from pytest_libero_max.worlds.libero.environment import build
from pytest_libero_max.worlds.libero.installation import Flavour, Installation, find_installation
from pytest_libero_max.worlds.libero.pro import ProVariation
from pytest_libero_max.worlds.libero.states import read_states
from pytest_libero_max.worlds.libero.tasks import task_of
from pytest_libero_max.worlds.libero.world import LiberoWorld
from pytest_libero_max.worlds.versions import version_notes

if TYPE_CHECKING:
    from pytest_libero_max.cases import Case

NAME = "libero"
KEPT_WORLDS = 8
"""Scenes kept for reuse in a process; each holds some 150 MB of meshes and textures."""

_PLAYED_BY: Mapping[str, tuple[Flavour, ...]] = {
    "libero": ("hf-libero", "LIBERO", "LIBERO-PRO", "LIBERO-Plus"),
}
"""Which installations can play the cases of a source, the preferred first. LIBERO-Plus comes last for plain
tasks: it rounds the camera's pose to four decimals."""

_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless", "bddl")


class LiberoSubstrate:
    """Builds worlds from an installed LIBERO.

    Args:
        installations: Which; by default whatever ``import libero`` would find.
        semantics: See :class:`.world.LiberoWorld`.

    Raises:
        SubstrateError: There is no installation, or there are two of one kind.
    """

    name = NAME

    def __init__(
        self, installations: Sequence[Installation] = (), semantics: Semantics = "published"
    ) -> None:
        self.installations = tuple(installations) or (find_installation(),)
        flavours = [found.flavour for found in self.installations]
        if len(set(flavours)) < len(flavours):
            raise SubstrateError(
                f"The installations are {', '.join(map(str, self.installations))}: give one of each kind."
            )
        for note in version_notes(version("mujoco"), version("robosuite")):
            warnings.warn(note, stacklevel=2)
        self.semantics = semantics
        self._worlds: dict[tuple[Flavour, str, int, int], LiberoWorld] = {}

    def installation_for(self, source: str) -> Installation:
        """The installation that plays cases of a source.

        Raises:
            SubstrateError: None of them can.
        """
        for flavour in _PLAYED_BY[source]:
            for found in self.installations:
                if found.flavour == flavour:
                    return found
        raise SubstrateError(
            f"Cases of source {source!r} need {' or '.join(_PLAYED_BY[source])}, but there is "
            f"{', '.join(map(str, self.installations))}. Give its folder with --libero-max-libero."
        )

    def world(self, case: Case) -> LiberoWorld:
        if case.source == "plus":
            raise SubstrateError(
                f"case {case.case_id!r} is of source 'plus' ({case.source_category}), which the genuine "
                "substrate does not play yet. Choose another track or substrate."
            )
        variation = ProVariation(case.source_category) if case.source == "pro" else None
        return self.task_world(case.suite, case.task_index, case.policy_seed).varied(variation)

    def task_world(self, suite: str, index: int, seed: int) -> LiberoWorld:
        """The world of an unmodified task, its fixtures placed as ``seed`` places them.

        Raises:
            SubstrateError: The installation cannot build it.
        """
        installation = self.installation_for("libero")
        key = (installation.flavour, suite, index, seed)
        if key in self._worlds:
            self._worlds[key] = self._worlds.pop(key)  # the last one used is the last one to go
        else:
            task = task_of(installation, suite, index)
            built = build(installation, task.bddl, seed)
            scene = f"{NAME}/{suite}/{index}?seed={seed}"
            states = read_states(task.states)
            self._worlds[key] = LiberoWorld(scene, task.language, built, states, self.semantics)
        while len(self._worlds) > KEPT_WORLDS:
            self._worlds.pop(next(iter(self._worlds))).close()
        return self._worlds[key]

    def fingerprint(self) -> Mapping[str, str]:
        """Versions of what computes a result, the GL backend, and what the installation is made of."""
        packages = {package: version(package) for package in _RESULT_PACKAGES}
        installations = {
            found.flavour: f"{found.version} sources {found.sources} assets {found.contents}"
            for found in self.installations
        }
        return {
            "substrate": NAME,
            "semantics": self.semantics,
            **installations,
            **packages,
            "gl": gl.prepare(),
        }

    def close(self) -> None:
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()
