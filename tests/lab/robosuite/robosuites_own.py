"""Control steps as robosuite plays them, on the environment of one of our worlds."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.worlds.contract import Array, WorldState
from tests.worlds.states import integration_state


def play_own(world: TaskWorld, state: WorldState, actions: Array) -> list[Array]:
    """Return MuJoCo's state after each step of robosuite's own loop, from a state of the world."""
    world.restore(state)
    env, parts = world._env, np.split(state.controller, [9, 11])
    robot = env.robots[0]
    robot.gripper.current_action = parts[1][: len(_one_command(robot.gripper))]
    robot.controller.goal_ori = parts[0].reshape(3, 3).copy()
    robot.controller.initial_joint = parts[2].copy()
    robot.controller.new_update = True
    states = []
    for action in actions:
        for substep in range(round(env.control_timestep / env.model_timestep)):
            env.sim.forward()
            env._pre_action(action, substep == 0)
            env.sim.step()
        states.append(integration_state(world.model, world.data))
    mujoco.mj_forward(world.model, world.data)
    return states


def _one_command(gripper: Any) -> Array:
    """Return the gripper's command as it keeps it: of one number where both fingers have the same."""
    before = gripper.current_action
    command = np.array(gripper.format_action(np.zeros(1)))
    gripper.current_action = before
    return command


def play_ours(world: TaskWorld, actions: Array) -> list[Array]:
    """Return MuJoCo's state after each step of our loop."""
    states = []
    for action in actions:
        world.step(action)
        states.append(integration_state(world.model, world.data))
    return states
