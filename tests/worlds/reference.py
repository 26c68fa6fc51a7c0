"""Robosuite itself, put into the state of an embedded world, to be stepped beside it."""

from __future__ import annotations

import mujoco
import numpy as np

from pytest_libero_max.worlds.embedded.env import SceneEnv
from pytest_libero_max.worlds.embedded.scene import Scene
from pytest_libero_max.worlds.embedded.substrate import EmbeddedWorld
from tests.worlds.states import set_integration_state


def twin(scene: Scene, world: EmbeddedWorld) -> SceneEnv:
    """A robosuite environment of the same scene in the same state, its controller included."""
    env = SceneEnv(scene)
    env.reset()
    state = world.snapshot()
    model, data = env.sim.model._model, env.sim.data._data
    set_integration_state(model, data, state.physics)
    mujoco.mj_forward(model, data)
    robot = env.robots[0]
    robot.controller.goal_ori = np.array(state.controller[:9]).reshape(3, 3)
    robot.controller.new_update = True
    robot.gripper.current_action = np.array(state.controller[9:])
    return env
