"""The genuine substrate: builds worlds from installations of LIBERO, one for each task and seed."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.kept_worlds import KeptWorlds
from pytest_libero_max.substrates.libero.initial_states import read_states
from pytest_libero_max.substrates.libero.installation import Installation, find_installations
from pytest_libero_max.substrates.libero.joints import Joints, by_joint
from pytest_libero_max.substrates.libero.lacking import PLAYED_BY, first_of
from pytest_libero_max.substrates.libero.package_env import Built, build
from pytest_libero_max.substrates.libero.plus import noise_of, plus_task
from pytest_libero_max.substrates.libero.pro import ProVariation
from pytest_libero_max.substrates.libero.pro_config import published_config
from pytest_libero_max.substrates.libero.pro_tasks import ProTask, pro_task
from pytest_libero_max.substrates.libero.tasks import Task, task_of
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.worlds import threads
from pytest_libero_max.worlds.contract import Array, Semantics
from pytest_libero_max.worlds.rendering import context
from pytest_libero_max.worlds.versions import version_notes

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

NAME = "libero"
KEPT_WORLDS = 2
"""Scenes kept for reuse in a process; each holds 0.15 to 0.4 GB of meshes and textures, and the one that is
drawn as much again."""

_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless", "bddl")


class LiberoSubstrate:
    """Builds worlds from an installed LIBERO.

    Args:
        installations: Installed packages; by default whatever ``import libero`` would find.
        instruction: Prompt that a policy gets where a case fixes none: ``published``, the authors', which
            for most of LIBERO-Plus's tasks has the name of the variation in it; or ``clean``, without.
        variation_of: Finds the package's own source variation that a case of LIBERO-Plus or LIBERO-PRO plays,
            made at reset on LIBERO's scenes. Without it, theirs are played, from their installations.

    Raises:
        SubstrateError: There is no installation, or there are two of one kind.
    """

    name = NAME

    def __init__(
        self,
        installations: Sequence[Installation] = (),
        semantics: Semantics = "published",
        instruction: Literal["published", "clean"] = "published",
        variation_of: Callable[[Case], Variation] | None = None,
    ) -> None:
        self.installations = tuple(installations) or find_installations()
        flavours = [installation.flavour for installation in self.installations]
        if len(set(flavours)) < len(flavours):
            raise SubstrateError(
                f"The installations are {', '.join(map(str, self.installations))}: give one of each kind."
            )
        for note in version_notes(version("mujoco"), version("robosuite")):
            warnings.warn(note, stacklevel=2)
        self.semantics = semantics
        self.instruction = instruction
        self._variation_of = variation_of
        self._worlds = KeptWorlds[str, LiberoWorld]()

    def installation_for(self, source: str) -> Installation:
        """Return the installation that plays cases of a source, or raise SubstrateError."""
        installation = first_of(self.installations, source)
        if installation is not None:
            return installation
        raise SubstrateError(
            f"Cases of source {source!r} need {' or '.join(PLAYED_BY[source])}, but there is "
            f"{', '.join(map(str, self.installations))}. Install it, or give its folder (pytest "
            "--libero-max-libero, libero-max --libero). `libero-max doctor` has the command. "
            "--libero-max-track=original needs LIBERO alone."
        )

    def world(self, case: Case) -> LiberoWorld:
        if self._variation_of is not None and not case.unmodified:
            return self.varied_world(self._variation_of(case), case.policy_seed)
        if case.source == "plus":
            return self.plus_world(
                case.suite, case.task_index, case.policy_seed, case.record.get("task_name")
            )
        if case.source == "pro":
            return self.pro_world(case)
        return self.task_world(case.suite, case.task_index, case.policy_seed).varied(None)

    def task_world(self, suite: str, index: int, seed: int) -> LiberoWorld:
        """Return the world of an unmodified task, its fixtures placed as ``seed`` places them.

        Raises:
            SubstrateError: The installation cannot build it.
        """
        installation = self.installation_for("libero")
        return self._world(installation, task_of(installation, suite, index), seed)

    def plus_world(self, suite: str, index: int, seed: int, name: str | None = None) -> LiberoWorld:
        """Return the world of a task of LIBERO-Plus's registry; see :func:`.plus.plus_task`.

        Raises:
            SubstrateError: LIBERO-Plus is not installed, or cannot build it.
        """
        installation = self.installation_for("plus")
        return self._world(installation, plus_task(installation, suite, index, name), seed)

    def varied_world(self, variation: Variation, seed: int) -> LiberoWorld:
        """Return the world of a task under a source variation of the package's own.

        Raises:
            SubstrateError: The variation is not made by changes at reset alone.
        """
        if variation.scene:
            raise SubstrateError(
                f"{variation.key} needs a scene of its own ({', '.join(sorted(variation.scene))}), and this "
                "package's own variations only change LIBERO's scenes at reset. Play it on the embedded "
                "substrate, or with --libero-max-substrate=libero:variations=installed."
            )
        return self.task_world(variation.suite, variation.base_index, seed).varied(variation.apply)

    def pro_world(self, case: Case) -> LiberoWorld:
        """Return the world of a case of LIBERO-PRO; see :mod:`.pro` and :func:`.pro_tasks.pro_task`.

        Raises:
            SubstrateError: The installation lacks a file, or cannot build it.
        """
        installation = self.installation_for("pro")
        task = pro_task(installation, case)
        world = self._world(installation, task, case.policy_seed)
        config = task.config
        if config is None:
            config = published_config(task.category, task.suite, task.index, world)
        return world.varied(ProVariation(config, case.event.seed).apply)

    def _world(self, installation: Installation, task: Task, seed: int) -> LiberoWorld:
        scene = f"{NAME}{task.source}/{task.suite}/{task.index}?seed={seed}"
        kept = self._worlds.used(scene)
        if kept is not None:
            return kept
        self._make_room()
        for earlier, world in self._worlds.items():
            world.rest(shareable=f"/{task.suite}/" in earlier)
        with task.description() as description:
            built = build(installation, description, seed, rebuild=self.semantics != "published")
        world = LiberoWorld(
            scene,
            task.language if self.instruction == "published" else task.clean_language,
            built,
            _states(installation, task, built, seed),
            self.semantics,
            noise=noise_of(built, scene),
        )
        world.open_task = partial(self.task_world, seed=seed)
        self._worlds[scene] = world
        return world

    def _make_room(self) -> None:
        """Let the oldest worlds go before another one is built.

        An environment refers to itself, so that it stays until cycles are collected, which Python would do
        much later: it does not see the gigabytes.
        """
        if self._worlds.shrink(KEPT_WORLDS - 1):
            gc.collect()

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        """Return versions of packages that compute results, the GL backend, digests of the installation.

        Args:
            images: See :func:`~pytest_libero_max.worlds.rendering.context.fingerprint`.
        """
        packages = {package: version(package) for package in _RESULT_PACKAGES}
        installations: dict[str, str] = {
            installation.flavour: (
                f"{installation.version} sources {installation.sources} assets {installation.contents}"
            )
            for installation in self.installations
        }
        return {
            "substrate": NAME,
            "semantics": self.semantics,
            "instruction_source": self.instruction,
            "source_variations": "installed" if self._variation_of is None else "own",
            **installations,
            **packages,
            **context.fingerprint(images),
            **threads.fingerprint(),
        }

    def close(self) -> None:
        self._worlds.close()


def _states(installation: Installation, task: Task, built: Built, seed: int) -> Array:
    """Return the initial states of a task as its scene takes them."""
    states = read_states(task.states)
    joints = Joints.of(built.env.sim.model._model)
    if isinstance(task, ProTask) and states.shape[1] != 1 + joints.nq + joints.nv:
        reference = build(installation, task.reference, seed, rebuild=False)
        start = np.array(built.env.sim.get_state().flatten())
        states = by_joint(states, Joints.of(reference.env.sim.model._model), joints, start)
        reference.env.close()
    return states
