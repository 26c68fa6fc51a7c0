"""robosuite's own environments, with spare objects beside them, and their initial states.

robosuite draws from NumPy's global generator: how large a cube is while it builds a scene, where things stand
while it resets one. Each draw is seeded by what it is for, and the generator is put back afterwards, so that
an initial state depends on task, arm and index alone.
"""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.identity import seed_of
from pytest_libero_max.lab.robosuite.robots import BENCHMARK
from pytest_libero_max.lab.robosuite.tasks import SPARES, Task
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.global_generators import global_generators_restored
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import ROBOT, MujocoRobot

gl.import_robosuite()

from robosuite.controllers import load_controller_config  # noqa: E402
from robosuite.environments.base import REGISTERED_ENVS  # noqa: E402
from robosuite.models.objects import BoxObject  # noqa: E402

BODIES = ("body_pos", "body_quat")
"""Fields of the model that a reset of robosuite's writes: where its door stands."""

FLAT = (f"{ROBOT}_head_1", f"{ROBOT}_head_4")
"""Meshes of the Sawyer without a volume, which MuJoCo from 3.3 on refuses unless it takes them for shells.
They are only drawn, and no inertia follows from them."""
TOUCHING = (f"{ROBOT}_right_arm_base_link", f"{ROBOT}_right_l0")
"""Bodies of the Sawyer, its base and its first link, that robosuite lets touch by a rounding error: with
MuJoCo 3.3.7 they overlap by 1.7e-16 m, and friction between them would hold the first joint."""


@dataclass(frozen=True)
class Start:
    """An initial state."""

    qpos: Array
    """(nq,) joint positions."""
    home: Array
    """(dofs,) rad: positions of the arm's joints, near which the controller holds them all the episode."""
    bodies: tuple[NDArray[Any], ...]
    """The fields :data:`BODIES`."""


def build(task: Task, robot: MujocoRobot) -> Any:
    """Build the environment of a task with an arm, and reset it."""
    with _seeded(task, robot, "scene"):
        env = _furnished(task)(
            robots=robot.name,
            controller_configs=load_controller_config(default_controller=robot.controller),
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            control_freq=robot.control_hz,
            ignore_done=True,
            hard_reset=False,
        )
        env.reset()
    return env


def draw_start(env: Any, task: Task, robot: MujocoRobot, init: int) -> Start:
    """Return an initial state as robosuite draws it. The environment is left in it."""
    with _seeded(task, robot, init):
        env.reset()
    model = env.sim.model._model
    return Start(
        np.array(env.sim.data._data.qpos),
        np.array(env.robots[0].controller.initial_joint),
        tuple(getattr(model, field).copy() for field in BODIES),
    )


@contextlib.contextmanager
def _seeded(task: Task, robot: MujocoRobot, what: object) -> Iterator[None]:
    with global_generators_restored():
        np.random.seed(seed_of(BENCHMARK, task.name, robot.name, what))  # noqa: NPY002 - it is robosuite's
        yield


def _furnished(task: Task) -> type[Any]:
    """Return the class of a task's environment, which compiles the task's spares with the scene."""
    own: Any = REGISTERED_ENVS[task.name]

    class Furnished(own):  # type: ignore[misc]
        def _load_model(self) -> None:
            super()._load_model()
            self.model.merge_objects([_block(task, spare.name) for spare in task.spares])
            _mend(self.model)

    return Furnished


def _mend(model: Any) -> None:
    """Let the Sawyer be compiled, and move, with this MuJoCo."""
    for mesh in model.asset.iter("mesh"):
        if mesh.get("name") in FLAT:
            mesh.set("inertia", "shell")
    if {body.get("name") for body in model.worldbody.iter("body")} >= {*TOUCHING}:
        ET.SubElement(model.contact, "exclude", dict(zip(("body1", "body2"), TOUCHING, strict=True)))


def _block(task: Task, name: str) -> Any:
    half, colour = SPARES[name]
    block = BoxObject(name, size=half, rgba=colour)
    block.get_obj().set("pos", " ".join(map(str, task.spare_place(name))))
    return block
