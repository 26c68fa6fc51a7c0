"""The embedded substrate: LIBERO's tasks in scenes of our own, on the installed robosuite."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds import gl
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.embedded.placement import initial_state
from pytest_libero_max.worlds.embedded.predicates import all_hold
from pytest_libero_max.worlds.embedded.scene import Scene, build_scene
from pytest_libero_max.worlds.embedded.tasks import Fact
from pytest_libero_max.worlds.robosuite_world import RobosuiteWorld

gl.prepare()

import mujoco  # noqa: E402

from pytest_libero_max.worlds.embedded.env import SceneEnv  # noqa: E402

if TYPE_CHECKING:
    from pytest_libero_max.cases import Case

NAME = "embedded"
_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless")


class EmbeddedWorld(RobosuiteWorld):
    """One embedded scene with its robot.

    The first reset to an initial state lays it out and lets it settle; later ones copy the result.
    """

    def __init__(self, task: Scene) -> None:
        super().__init__(f"{NAME}/{task.key}", task.language, SceneEnv(task), task.entities)
        self._task = task
        self._starts: dict[int, Array] = {}
        self.reset(0)

    @property
    def goal(self) -> tuple[Fact, ...]:
        """What must hold at the end, all of it, in the task's own words: for policies that are privileged."""
        return self._task.task.goal

    def succeeded(self) -> bool:
        return all_hold(self._task.goal, self._model, self._data)

    def _initial_qpos(self, init: int) -> Array:
        if init not in self._starts:
            # Initial states belong to the compiled scene, whatever an event has done to it since.
            self._write_model(self._compiled)
            scratch = mujoco.MjData(self._model)
            self._starts[init] = initial_state(self._task, self._model, scratch, init)
        return self._starts[init]


class EmbeddedSubstrate:
    """Builds a world for each task once and keeps it."""

    name = NAME

    def __init__(self) -> None:
        self._worlds: dict[tuple[str, int], EmbeddedWorld] = {}

    def world(self, case: Case) -> EmbeddedWorld:
        if case.source != "libero":
            raise SubstrateError(
                f"case {case.case_id!r} is of source {case.source!r} ({case.source_category}): the embedded "
                "substrate builds LIBERO's unmodified tasks only. Choose another track or substrate."
            )
        key = (case.suite, case.task_index)
        if key not in self._worlds:
            self._worlds[key] = EmbeddedWorld(build_scene(*key))
        return self._worlds[key]

    def fingerprint(self) -> Mapping[str, str]:
        """Versions of what computes a result, the GL backend, and a digest of the scenes' source code."""
        return self._fingerprint

    @cached_property
    def _fingerprint(self) -> Mapping[str, str]:
        here = Path(__file__).parent
        assets = hashlib.sha256()
        for source in sorted(here.rglob("*.py")):
            assets.update(source.relative_to(here).as_posix().encode() + b"\0" + source.read_bytes())
        packages = {package: version(package) for package in _RESULT_PACKAGES}
        return {"substrate": NAME, **packages, "gl": gl.prepare(), "assets": assets.hexdigest()}

    def close(self) -> None:
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()
