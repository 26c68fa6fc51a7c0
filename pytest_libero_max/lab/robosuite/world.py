"""A task of robosuite as a world: its own environment decides success, our loop plays its control steps.

An episode begins in a state that robosuite's reset drew, with its controller up to date in it; robosuite's
own first substep still computes with the gripper where it was before the reset put it into place. Objects
that robosuite throws out of the scene, because another task is about them, are parked. Success is judged
after a step is over; robosuite judges with the positions of the step's last substep, 2 ms before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.lab.robosuite.environments import BODIES, Start, build, draw_start
from pytest_libero_max.lab.robosuite.robots import BENCHMARK
from pytest_libero_max.lab.robosuite.tasks import Task
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.robosuite_world import RobosuiteWorld
from pytest_libero_max.worlds.robot import MujocoRobot

INITS = 50
"""Number of initial states of a task."""

_WAITING_M = (-3.0, 0.0, -5.0)
"""Position of the first parked object, m, world: below the floor; the others follow along y."""


class TaskWorld(RobosuiteWorld):
    """A task with an arm."""

    def __init__(self, task: Task, robot: MujocoRobot) -> None:
        self._task = task
        self._arm = robot
        self._starts: dict[int, Start] = {}
        env = build(task, robot)
        super().__init__(f"{BENCHMARK}/{task.name}/{robot.name}", task.language, env, task.entities, robot)
        self.reset(0)

    @property
    def task(self) -> Task:
        """The task."""
        return self._task

    @property
    def arm(self) -> MujocoRobot:
        """The robot, with the names of its parts."""
        return self._arm

    def reset(self, init: int) -> None:
        self._start = self._start_of(init)
        super().reset(init)
        for number, entity in enumerate((*self._task.idle, *self._task.spares)):
            x, y, z = _WAITING_M
            self.park(entity.name, (x, y + 0.5 * number, z))

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        super().park(entity, position)
        # In the order of the entities: of several, one that came and went again leaves no trace.
        self._parked = {name: self._parked[name] for name in self._entities if name in self._parked}

    def succeeded(self) -> bool:
        return bool(self._env._check_success())

    def _start_of(self, init: int) -> Start:
        if not 0 <= init < INITS:
            raise SubstrateError.seen("init", init, f": {self._scene} has initial states 0 to {INITS - 1}.")
        if init not in self._starts:
            self._starts[init] = draw_start(self._env, self._task, self._arm, init)
        return self._starts[init]

    def _initial_qpos(self, init: int) -> Array:
        return self._start.qpos

    def _write_start(self, qpos: Array) -> None:
        super()._write_start(qpos)
        for field, values in zip(BODIES, self._start.bodies, strict=True):
            self._alterable[field][:] = values

    def _reset_controller(self) -> None:
        self._stepper.home[:] = self._start.home
        super()._reset_controller()

    def _controller_state(self) -> Array:
        return np.concatenate([super()._controller_state(), self._stepper.home])

    def _set_controller_state(self, state: Array) -> None:
        grip, self._stepper.home[:] = np.split(state, [-len(self._stepper.home)])
        super()._set_controller_state(grip)

    def _task_fields(self) -> Mapping[str, Any]:
        return {"goal": self._task.goal, "task": self._task.name}
