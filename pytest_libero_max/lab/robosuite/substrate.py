"""The substrate of robosuite's tasks: builds worlds, and keeps those used last."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.lab.robosuite.robots import BENCHMARK, ROBOTS
from pytest_libero_max.lab.robosuite.tasks import task_of
from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.substrates.kept_worlds import KeptWorlds
from pytest_libero_max.worlds import threads
from pytest_libero_max.worlds.rendering import context

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

KEPT_WORLDS = 3
"""Worlds kept for reuse in a process."""

_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless")


class RobosuiteSubstrate:
    """One world for each task and arm."""

    name = BENCHMARK

    def __init__(self) -> None:
        self._worlds = KeptWorlds[tuple[str, int], TaskWorld]()

    def world(self, case: Case) -> TaskWorld:
        return self.task_world(case.suite, case.task_index)

    def task_world(self, suite: str, index: int) -> TaskWorld:
        """Return the world of a task.

        Raises:
            SubstrateError: There is no such suite or task.
        """
        if suite not in ROBOTS:
            raise SubstrateError.seen("suite", suite, f" is none of robosuite. {did_you_mean(suite, ROBOTS)}")
        task, key = task_of(index), (suite, index)
        kept = self._worlds.used(key)
        if kept is not None:
            return kept
        self._worlds.shrink(KEPT_WORLDS - 1)
        world = self._worlds[key] = TaskWorld(task, ROBOTS[suite])
        world.open_task = self.task_world
        return world

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {
            "substrate": self.name,
            "control_step": "compiled",
            **{package: version(package) for package in _RESULT_PACKAGES},
            **context.fingerprint(images),
            **threads.fingerprint(),
        }

    def close(self) -> None:
        self._worlds.close()
