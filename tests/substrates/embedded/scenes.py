"""Compiled scenes without a robot, one of each for the whole test session."""

from __future__ import annotations

from functools import cache

import mujoco

from pytest_libero_max.substrates.embedded.placement import initial_state
from pytest_libero_max.substrates.embedded.scene import Scene, build_scene
from pytest_libero_max.tasks.libero_tasks import SUITES, tasks

ALL = [(row.suite, row.index) for suite in SUITES for row in tasks(suite)]
IDS = [f"{suite}/{index}" for suite, index in ALL]


@cache
def compiled(suite: str, index: int) -> tuple[Scene, mujoco.MjModel]:
    scene = build_scene(suite, index)
    return scene, mujoco.MjModel.from_xml_string(scene.mjcf)


@cache
def _start(suite: str, index: int, init: int) -> bytes:
    scene, model = compiled(suite, index)
    return initial_state(scene, model, mujoco.MjData(model), init).tobytes()


def at_start(suite: str, index: int, init: int = 0) -> tuple[Scene, mujoco.MjModel, mujoco.MjData]:
    import numpy as np

    scene, model = compiled(suite, index)
    data = mujoco.MjData(model)
    data.qpos[:] = np.frombuffer(_start(suite, index, init))
    mujoco.mj_forward(model, data)
    return scene, model, data


def control_steps(model: mujoco.MjModel, data: mujoco.MjData, count: int) -> None:
    mujoco.mj_step(model, data, 25 * count)
