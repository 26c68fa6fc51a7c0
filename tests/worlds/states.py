"""What the tests of worlds compare: whole models, whole integration states."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds.contract import Array

_INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


def integration_state(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    state = np.empty(mujoco.mj_stateSize(model, _INTEGRATION))
    mujoco.mj_getState(model, data, state, _INTEGRATION)
    return state


def set_integration_state(model: mujoco.MjModel, data: mujoco.MjData, state: Array) -> None:
    mujoco.mj_setState(model, data, np.array(state), _INTEGRATION)


def every_array(model: mujoco.MjModel) -> dict[str, NDArray[Any]]:
    """Copies of all arrays of a compiled model, by field."""
    fields = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    return {name: value.copy() for name, value in fields.items() if isinstance(value, np.ndarray)}


def differing(before: dict[str, NDArray[Any]], after: dict[str, NDArray[Any]]) -> list[str]:
    return [name for name in before if not np.array_equal(before[name], after[name], equal_nan=True)]


def random_actions(seed: int, count: int) -> Array:
    """(count, 7): beyond +-1, with stretches without rotation and steps that hold the gripper."""
    generator = np.random.default_rng(seed)
    actions = generator.uniform(-1.4, 1.4, (count, 7))
    actions[count // 4 : count // 2, 3:6] = 0.0
    actions[::5, 6] = 0.0
    return actions


def random_poses(near: Array, seed: int, count: int) -> Array:
    """(count, 7): poses within 10 cm of a position, m, turned in all ways, once not at all."""
    generator = np.random.default_rng(seed)
    poses = generator.uniform(-1.4, 1.4, (count, 7))
    poses[:, :3] = near + 0.07 * poses[:, :3]
    poses[:, 3:6] *= 2.0
    poses[count // 2, 3:6] = 0.0
    poses[::5, 6] = 0.0
    return poses
