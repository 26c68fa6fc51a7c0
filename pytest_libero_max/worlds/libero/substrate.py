"""The genuine substrate: one installation, one world for each task and seed, built on first use."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds import gl
from pytest_libero_max.worlds.libero.environment import build
from pytest_libero_max.worlds.libero.installation import Installation, find_installation
from pytest_libero_max.worlds.libero.states import read_states
from pytest_libero_max.worlds.libero.tasks import task_of
from pytest_libero_max.worlds.libero.world import LiberoWorld, Semantics

if TYPE_CHECKING:
    from pytest_libero_max.cases import Case

NAME = "libero"
_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless", "bddl")


class LiberoSubstrate:
    """Builds worlds from an installed LIBERO.

    Args:
        installation: Which one; by default whatever ``import libero`` would find.
        semantics: See :class:`.world.LiberoWorld`.

    Raises:
        SubstrateError: There is no installation.
    """

    name = NAME

    def __init__(self, installation: Installation | None = None, semantics: Semantics = "published") -> None:
        self.installation = find_installation() if installation is None else installation
        self.semantics = semantics
        self._worlds: dict[tuple[str, int, int], LiberoWorld] = {}

    def world(self, case: Case) -> LiberoWorld:
        if case.source != "libero":
            raise SubstrateError(
                f"case {case.case_id!r} is of source {case.source!r} ({case.source_category}): "
                f"{self.installation} plays LIBERO's unmodified tasks only. Choose another substrate."
            )
        return self.task_world(case.suite, case.task_index, case.policy_seed)

    def task_world(self, suite: str, index: int, seed: int) -> LiberoWorld:
        """The world of an unmodified task, its fixtures placed as ``seed`` places them.

        Raises:
            SubstrateError: The installation cannot build it.
        """
        key = (suite, index, seed)
        if key not in self._worlds:
            task = task_of(self.installation, suite, index)
            built = build(self.installation, task.bddl, seed)
            scene = f"{NAME}/{suite}/{index}" + ("" if seed == 0 else f"?seed={seed}")
            states = read_states(task.states)
            self._worlds[key] = LiberoWorld(scene, task.language, built, states, self.semantics)
        return self._worlds[key]

    def fingerprint(self) -> Mapping[str, str]:
        """Versions of what computes a result, the GL backend, and what the installation is made of."""
        packages = {package: version(package) for package in _RESULT_PACKAGES}
        found = self.installation
        return {
            "substrate": NAME,
            "flavour": found.flavour,
            "flavour_version": found.version,
            "semantics": self.semantics,
            **packages,
            "gl": gl.prepare(),
            "sources": found.sources,
            "assets": found.contents,
        }

    def close(self) -> None:
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()
