"""The recording of a task reference from a world that keeps LIBERO's conventions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, step_budget
from pytest_libero_max.conformance.environment.reference import Move, RobotState, TaskReference, encoded
from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.worlds.contract import Array, Observation, World
from pytest_libero_max.worlds.robot import CAMERAS, CONTROL_HZ, NOOP_ACTION
from pytest_libero_max.worlds.rotations import inverse, multiply, quaternion, vector_of

STARTS = 10
"""Number of initial states of which the robot is recorded."""

LONGEST_SETTLING = 30

MOVE_STEPS = 5

OPENING_STEPS = 10
"""Steps of the gripper in one direction."""

SIGNS = (-1.0, 1.0, -1.0)
"""Commands of the gripper, one after the other."""

_IMAGE = 256


def robot_state(observation: Observation) -> RobotState:
    """Return the robot's state of an observation with LIBERO's keys, rounded to 0.1 micrometres."""
    values = {
        "position": observation["robot0_eef_pos"],
        "quaternion": observation["robot0_eef_quat"],
        "gripper": observation["robot0_gripper_qpos"],
    }
    rounded = {name: tuple(np.round(value, 7).tolist()) for name, value in values.items()}
    return RobotState(**rounded, joints=np.round(observation["robot0_joint_pos"], 7).tolist())


def turn_between(before: Sequence[float] | Array, after: Sequence[float] | Array) -> Array:
    """(3,) rad: axis times angle of the rotation from one orientation to another, both xyzw, in the world."""
    first, second = (quaternion(np.roll(np.asarray(each, dtype=float), 1)) for each in (before, after))
    return np.array(vector_of(multiply(second, inverse(first))))


def record(
    world: World,
    actions: Sequence[Sequence[float]] | Array,
    *,
    task: str,
    init: int = 0,
    versions: Mapping[str, str] | None = None,
) -> TaskReference:
    """Play a world, and return what an environment of the same task is compared with.

    Args:
        actions: (N, 7): an episode from the settled state in which the task is solved.
        task: Suite and number, ``libero_spatial/0``.
        init: Index of the initial state of that episode.
        versions: Packages of its simulator.

    Raises:
        SubstrateError: The actions do not solve the task.
    """
    budget = step_budget(task.partition("/")[0])
    if budget is None:
        raise SubstrateError.seen(
            "task", task, ", but must be the suite and the number of one of LIBERO's tasks."
        )
    settled = _settled(world, init, CAMERAS)
    pictures = {camera: encoded(settled[f"{camera}_image"]) for camera in CAMERAS}
    moves = [_move(world, init, component) for component in range(6)]
    openings = _openings(world, init)
    steps, success_step = _episode(world, init, actions)
    return TaskReference(
        task=task,
        instruction=world.language,
        versions=dict(versions or {}),
        budget=budget,
        control_hz=CONTROL_HZ,
        settle_steps=SETTLE_STEPS,
        init=init,
        starts=[robot_state(_settled(world, index)) for index in range(STARTS)],
        settling=_settling(world, init),
        moves=moves,
        openings=openings,
        pictures=pictures,
        actions=[[float(value) for value in action] for action in actions[:success_step]],
        steps=steps,
        success_step=success_step,
    )


def _settled(world: World, init: int, cameras: Sequence[str] = ()) -> Observation:
    world.reset(init)
    for _ in range(SETTLE_STEPS):
        world.step(NOOP_ACTION)
    return world.observe(cameras, _IMAGE)


def _settling(world: World, init: int) -> list[RobotState]:
    world.reset(init)
    states = [robot_state(world.observe(()))]
    for _ in range(LONGEST_SETTLING):
        world.step(NOOP_ACTION)
        states.append(robot_state(world.observe(())))
    return states


def _move(world: World, init: int, component: int) -> Move:
    before = robot_state(_settled(world, init))
    action = [*NOOP_ACTION]
    action[component] = 1.0
    for _ in range(MOVE_STEPS):
        world.step(action)
    after = robot_state(world.observe(()))
    way = np.round(np.subtract(after.position, before.position), 7)
    turn = np.round(turn_between(before.quaternion, after.quaternion), 7)
    return Move(action=action, steps=MOVE_STEPS, way=tuple(way.tolist()), turn=tuple(turn.tolist()))


def _openings(world: World, init: int) -> list[float]:
    _settled(world, init)
    openings = []
    for sign in SIGNS:
        for _ in range(OPENING_STEPS):
            world.step((*NOOP_ACTION[:6], sign))
        openings.append(round(float(np.abs(world.observe(())["robot0_gripper_qpos"]).sum()), 7))
    return openings


def _episode(
    world: World, init: int, actions: Sequence[Sequence[float]] | Array
) -> tuple[list[RobotState], int]:
    _settled(world, init)
    states = []
    for number, action in enumerate(actions, 1):
        world.step(action)
        states.append(robot_state(world.observe(())))
        if world.succeeded():
            return states, number
    raise SubstrateError(
        f"{counted(len(states), 'action')} did not solve the task from initial state {init}: "
        "record an episode that does."
    )
