"""What the tests of changes compare: everything a world holds, factor by factor."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from pytest_libero_max.benchmark.cases import Event
from pytest_libero_max.changes import Change, change_from_dict
from pytest_libero_max.worlds.mujoco_world import MujocoWorld

MODEL_ARRAYS = tuple(
    name
    for name in dir(mujoco.MjModel)
    if not name.startswith("_") and not callable(getattr(mujoco.MjModel, name, None))
)


def model_arrays(world: MujocoWorld) -> dict[str, np.ndarray]:
    """A copy of every array of the MuJoCo model."""
    values = {name: getattr(world.model, name) for name in MODEL_ARRAYS}
    return {name: value.copy() for name, value in values.items() if isinstance(value, np.ndarray)}


def full_state(world: MujocoWorld) -> dict[str, Any]:
    """Model, physics, controller, filters and parking as comparable values."""
    state = world.snapshot()
    return {
        **{f"model.{name}": array for name, array in model_arrays(world).items()},
        "qpos": world.data.qpos.copy(),
        "qvel": world.data.qvel.copy(),
        "physics": state.physics.copy(),
        "controller": state.controller.copy(),
        "steps": state.steps,
        "filters": state.filters,
        "parked": state.parked,
    }


def differing(before: dict[str, Any], after: dict[str, Any]) -> set[str]:
    """Names of the values that are not bit-identical."""
    return {name for name, value in before.items() if not same(value, after[name])}


def same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.shape == other.shape and one.tobytes() == other.tobytes()
    return bool(one == other)


def pose_bytes(world: MujocoWorld, entity: str) -> bytes:
    position, quaternion = world.pose(entity)
    return position.tobytes() + quaternion.tobytes()


def velocity_slices(world: MujocoWorld) -> dict[str, slice]:
    """Where each object's velocity is in qvel."""
    slices = {}
    for name, entity in world.entities.items():
        if entity.kind == "object":
            first = int(world.model.body(entity.body).dofadr[0])
            slices[name] = slice(first, first + 6)
    return slices


def position_slices(world: MujocoWorld) -> dict[str, slice]:
    """Where each object's pose is in qpos."""
    slices = {}
    for name, entity in world.entities.items():
        if entity.kind == "object":
            joint = int(world.model.body(entity.body).jntadr[0])
            first = int(world.model.jnt_qposadr[joint])
            slices[name] = slice(first, first + 7)
    return slices


def play(world: MujocoWorld, actions: Iterable[Any]) -> None:
    for action in actions:
        world.step(action)


def set_up(world: MujocoWorld, event: Event) -> Change:
    """Apply the event's setup and return its change."""
    for raw in event.setup:
        change_from_dict(raw).apply(world)
    return change_from_dict(event.change)
