"""Recording of genuine LIBERO in one task, as a value that an environment is compared with.

A reference is recorded once, from a world (:func:`record`), and read by processes that have neither LIBERO
nor its models. It holds the robot's state, small pictures and outcomes, and no initial state.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, step_budget
from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import Count, Document, Positive, Text, decode
from pytest_libero_max.errors import OptionError, ReportError, SubstrateError, counted, did_you_mean
from pytest_libero_max.worlds.contract import Array, Observation, World
from pytest_libero_max.worlds.robot import CAMERAS, CONTROL_HZ, NOOP_ACTION
from pytest_libero_max.worlds.rotations import inverse, multiply, quaternion, vector_of

REFERENCE_VERSION: Final = 1
"""Version of the document's form."""

FOLDER = Path(__file__).parent / "references"

SIDE = 32
"""Side of a small picture, pixels."""


class RobotState(Document, frozen=True, kw_only=True):
    """The robot's state in an observation, by LIBERO's conventions."""

    position: tuple[float, float, float]
    """Of the grip site, m, world."""
    quaternion: tuple[float, float, float, float]
    """Of the hand, xyzw, with the sign that is observed."""
    gripper: tuple[float, float]
    """Positions of the two finger joints, m."""
    joints: list[float]
    """Positions of the arm's joints, rad."""


class Move(Document, frozen=True, kw_only=True):
    """The way of the hand under the same action for some steps, from the settled state."""

    action: list[float]
    """(7,), repeated."""
    steps: Positive
    way: tuple[float, float, float]
    """Displacement of the grip site, m, world."""
    turn: tuple[float, float, float]
    """Rotation of the hand as axis times angle, rad, world."""


class TaskReference(Document, frozen=True, kw_only=True):
    """One task as genuine LIBERO plays it."""

    schema_version: Literal[1] = REFERENCE_VERSION
    """Version of this document's form."""
    task: Text
    """Suite and number, for example ``libero_spatial/0``."""
    instruction: Text
    """The instruction that LIBERO's benchmark gives."""
    versions: dict[str, str]
    """Packages of the simulator that it was recorded with."""
    budget: Positive
    """Policy steps of an episode."""
    control_hz: Positive
    """Control steps in a second of simulated time."""
    settle_steps: Count
    """No-op steps before the first policy step."""
    init: Count
    """Index of the initial state of everything that follows :attr:`starts`."""
    starts: list[RobotState]
    """The robot in initial states 0, 1, 2, ..., after the settle steps."""
    settling: list[RobotState]
    """The robot after 0, 1, 2, ... no-op steps."""
    moves: list[Move]
    """One for each of the first six components of an action, of +1."""
    openings: list[float]
    """Sums of the two finger joints' absolute positions after ten steps of -1, then +1, then -1, m."""
    pictures: dict[str, str]
    """Images of the settled state by camera, :data:`SIDE` square, RGB as delivered, base64."""
    actions: list[list[float]]
    """(N, 7): an episode in which the task is solved, from the settled state."""
    steps: list[RobotState]
    """The robot after each of them."""
    success_step: Positive
    """Number of them after which the goal holds for the first time."""

    def picture(self, camera: str) -> NDArray[np.float64]:
        """(SIDE, SIDE, 3): the small image of a camera, 0 to 255."""
        flat = np.frombuffer(base64.b64decode(self.pictures[camera]), np.uint8)
        return flat.reshape(SIDE, SIDE, 3).astype(np.float64)


def shrink(image: NDArray[np.uint8]) -> Array:
    """(SIDE, SIDE, 3) of an (H, W, 3) image: the mean of the pixels below each small one."""
    rows, columns = (_bounds(length) for length in image.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(image.astype(np.float64), rows, axis=0), columns, axis=1)
    heights, widths = np.diff([*rows, image.shape[0]]), np.diff([*columns, image.shape[1]])
    small: Array = sums / (heights[:, None, None] * widths[None, :, None])
    return small


def _bounds(length: int) -> list[int]:
    return [length * number // SIDE for number in range(SIDE)]


def encoded(image: NDArray[np.uint8]) -> str:
    """Return an image as :attr:`TaskReference.pictures` holds it."""
    return base64.b64encode(np.rint(shrink(image)).astype(np.uint8).tobytes()).decode()


def references() -> Mapping[str, Path]:
    """Return the references that come with the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.json"))}


def read_reference(name: str | Path) -> TaskReference:
    """Read a reference of this package by its name, or any other by its path."""
    shipped = references()
    path = shipped.get(str(name), Path(name))
    if not path.is_file():
        raise OptionError.seen(
            "reference",
            str(name),
            f", but there is no such file and no reference of this name. {did_you_mean(str(name), shipped)}",
        )
    try:
        return decode(read_text(path).encode(), TaskReference)
    except ReportError as error:
        raise OptionError(f"reference={str(path)!r} is no task reference: {error}", path=path) from None


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
