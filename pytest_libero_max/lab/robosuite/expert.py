"""``robosuite-expert``: a scripted policy that reads the simulator, one for all tasks and arms.

It has no memory. At every query it reads where the hand and the things of the task are, and plans the route
to the end: over the target, down, close, over the goal, down, open, away. What slipped out of the fingers or
was moved is a route from there. The door has a route of its own (:mod:`.door`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint, follow
from pytest_libero_max.experts.scene_view import Hand, read_hand
from pytest_libero_max.lab.robosuite.door import open_door
from pytest_libero_max.lab.robosuite.robots import ROBOTS, SAWYER, UR5E
from pytest_libero_max.lab.robosuite.tasks import BIN_FLOOR_M, TABLE_TOP_M
from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array, Observation
from pytest_libero_max.worlds.robot import GRIPPER, PANDA


@dataclass(frozen=True)
class HandShape:
    """A hand that points down."""

    neutral_rad: float
    """Horizontal direction of the axis of its fingers in the middle of the wrist's range."""
    tip_m: float
    """Distance of its fingertips below the grip site."""
    palm_m: float
    """Distance of its palm above the grip site."""
    pads: tuple[str, str]
    """Geoms of the pads of its fingers."""
    open_m: float
    """Distance between the middles of the pads from which it counts as open."""


def _pads(first: str, second: str) -> tuple[str, str]:
    return f"{GRIPPER}_{first}", f"{GRIPPER}_{second}"


_UP = math.pi / 2
_SHAPES = MappingProxyType(
    {
        PANDA.name: HandShape(
            _UP, 0.012, 0.026, _pads("finger1_pad_collision", "finger2_pad_collision"), 0.07
        ),
        UR5E.name: HandShape(
            _UP, 0.009, 0.05, _pads("left_fingerpad_collision", "right_fingerpad_collision"), 0.07
        ),
        SAWYER.name: HandShape(_UP, 0.014, 0.04, _pads("l_fingerpad_g0", "r_fingerpad_g0"), 0.06),
    }
)


def shape_of(robot: str) -> HandShape:
    """Return the hand of an arm."""
    return _SHAPES[robot]


def is_open(world: TaskWorld) -> bool:
    """Return True if the fingers of a world's hand are open."""
    shape = shape_of(world.arm.name)
    first, second = (world.data.geom(pad).xpos for pad in shape.pads)
    return bool(np.linalg.norm(first - second) > shape.open_m)


_TRAVEL_M = 0.185  # height of the hand above what things stand on, on its way
_CLOSE_STEPS, _OPEN_STEPS = 13, 10
_AT_M, _AT_RAD = 0.006, 0.1  # the hand is where it takes hold
_FUNNEL_M, _WIDENING = 0.008, 0.2  # radius of the funnel above that place, and how it grows with the height
_GAP_M = 0.003  # between the fingertips and what things stand on
_PALM_M = (0.11, 0.04)  # half sizes of a hand, along its fingers' axis and across
_QUARTER = math.pi / 2
_WRIST_RAD = 1.65  # turn from the middle of its range that every wrist can make
_EASY_REACH_M = 0.72  # horizontal distance from the base beyond which an arm is outstretched


@dataclass(frozen=True)
class Job:
    """Poses of a task: where its target is held, and where that has to go."""

    target: str
    floor_m: float
    """Height of what it stands on."""
    point_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Place between the fingers, in the frame of the target."""
    across: tuple[float, float, float] | None = None
    """Direction in that frame in which the fingers close; None for any."""
    period_rad: float = math.pi
    """Turn after which it can be held in the same way."""
    goal: Callable[[TaskWorld], Array] | None = None
    """Returns the place (3,) of its origin where it is let go, m, world; None to lift it."""
    square: bool = False
    """True if its axes have to be those of the world at the goal."""
    near_m: float = 0.02
    """Horizontal distance from the goal within which it counts as there."""
    slack_m: float = 0.006
    """Distance at which a place above the goal counts as reached."""


def _on_the_green_cube(world: TaskWorld) -> Array:
    place: Array = world.position("cubeB") + np.array([0.0, 0.0, 0.047])
    return place


def _in_its_bin(world: TaskWorld) -> Array:
    return np.array([0.155, 0.35, BIN_FLOOR_M + 0.08])  # of the quarter with its picture the near corner


def _on_the_peg(world: TaskWorld) -> Array:
    return np.array([*world.position("peg1")[:2], 0.858])


JOBS: Mapping[str, Job] = MappingProxyType(
    {
        "Lift": Job("cube", TABLE_TOP_M, across=(1.0, 0.0, 0.0), period_rad=_QUARTER),
        "Stack": Job(
            "cubeA", TABLE_TOP_M, across=(1.0, 0.0, 0.0), period_rad=_QUARTER, goal=_on_the_green_cube
        ),
        "PickPlaceCan": Job(
            "Can", BIN_FLOOR_M, point_m=(0.0, 0.0, 0.02), goal=_in_its_bin, near_m=0.05, slack_m=0.02
        ),
        "NutAssemblySquare": Job(
            "SquareNut", 0.82, point_m=(0.06, 0.0, 0.0), across=(0.0, 1.0, 0.0), goal=_on_the_peg, square=True
        ),
    }
)


@dataclass(frozen=True)
class Grip:
    """A pose of the hand, pointing down."""

    position: Array
    """(3,) m, world, between the fingertips."""
    angle: float
    """Horizontal direction of the axis of the fingers, rad."""


class RobosuiteExpert:
    """Plans anew at every query. It asks for the images that a learned policy would get, and ignores them."""

    spec = PolicySpec(
        "robosuite-expert", horizon=10, query_interval=5, privileged=True, robot=None, suites=tuple(ROBOTS)
    )

    def reset(self, episode: Episode) -> None:
        """Keep the world to read.

        Raises:
            AdapterError: It is no task of robosuite.
        """
        if not isinstance(episode.world, TaskWorld):
            raise AdapterError(
                f"policy {self.spec.name!r} knows the tasks of robosuite, not {episode.world!r}. Play it "
                "with --libero-max-substrate=robosuite."
            )
        self._world = episode.world

    def predict(self, observation: Observation, query: Query) -> Array:
        world = self._world
        hand = read_hand(world, world.arm)
        route = open_door(world, hand) if world.task.name == "Door" else plan(world, hand)
        return follow(hand, route, self.spec.horizon)[0]


def plan(world: TaskWorld, hand: Hand) -> Route:
    """Return the route to the end of a task that brings or lifts something."""
    job, shape = JOBS[world.task.name], shape_of(world.robot.name)
    up = np.array([0.0, 0.0, 0.1])
    held = world.fingers_on(job.target) == len(world.arm.finger_joints)
    if not held and (world.succeeded() or _is_there(world, job)):
        return (Waypoint(hand.position + up, hand.angle, OPEN),)
    grip = choose_grip(world, job, shape)
    near = float(np.linalg.norm(hand.position - grip.position)) < 0.04
    if held and near:
        return (*_carry(world, job, Grip(hand.position, hand.angle)),)
    return (*_pick(world, job, hand, grip), *_carry(world, job, grip))


def _is_there(world: TaskWorld, job: Job) -> bool:
    if job.goal is None:
        return False
    off = world.position(job.target) - job.goal(world)
    return bool(np.linalg.norm(off[:2]) < job.near_m and off[2] < 0.01)


def choose_grip(world: TaskWorld, job: Job, shape: HandShape) -> Grip:
    """Return where to take hold of the target: with room for the hand, then with little turning."""
    position, turn = world.pose(job.target)
    frame = rotations.quaternion(turn)
    point = position + np.array(rotations.rotate(frame, job.point_m))
    point[2] = max(point[2], job.floor_m + shape.tip_m + _GAP_M)
    if job.across is None:
        angles = [shape.neutral_rad + step * _QUARTER / 4 for step in range(-2, 3)]
    else:
        x, y, _ = rotations.rotate(frame, job.across)
        first = math.atan2(y, x)
        steps = range(round(2 * math.pi / job.period_rad))
        angles = [first + step * job.period_rad for step in steps]
    angles = [shape.neutral_rad + math.remainder(angle - shape.neutral_rad, 2 * math.pi) for angle in angles]
    best = min(angles, key=lambda angle: _cost(world, job, point, angle, shape))
    return Grip(point, best)


def _cost(world: TaskWorld, job: Job, point: Array, angle: float, shape: HandShape) -> float:
    """Return the number of things that would be under the hand, and how far it turns, rad."""
    along, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    crowd = 0
    for name, entity in world.entities.items():
        if entity.kind != "object" or name == job.target or name in world.parked:
            continue
        off, radius = world.position(name)[:2] - point[:2], world.radius_m(name)
        top = world.top_m(name)
        is_high = top is not None and top > point[2] + shape.palm_m - 0.01
        if is_high and abs(off @ along) < _PALM_M[0] + radius and abs(off @ across) < _PALM_M[1] + radius:
            crowd += 1
    return 10.0 * crowd + abs(angle - shape.neutral_rad)


def _pick(world: TaskWorld, job: Job, hand: Hand, grip: Grip) -> Route:
    """Go up, over the target, down to it, and close the fingers."""
    close = Waypoint(grip.position, grip.angle, CLOSED, math.inf, _CLOSE_STEPS)
    down = Waypoint(grip.position, grip.angle, OPEN, 0.003)
    off = hand.position - grip.position
    askew = abs(math.remainder(hand.angle - grip.angle, 2 * math.pi)) + hand.tilt
    if np.linalg.norm(off) < _AT_M and askew < _AT_RAD:
        return (close,)
    in_funnel = off[2] > -0.01 and np.linalg.norm(off[:2]) < _FUNNEL_M + _WIDENING * max(0.0, off[2])
    if is_open(world) and in_funnel and askew < 2 * _AT_RAD:
        return (down, close)
    high = job.floor_m + _TRAVEL_M
    over = Waypoint(np.array([*grip.position[:2], high]), grip.angle, OPEN, 0.01)
    if hand.position[2] > high - 0.05:
        return (over, down, close)
    up = Waypoint(np.array([*hand.position[:2], high]), hand.angle, OPEN, 0.03)
    return (up, over, down, close)


def _carry(world: TaskWorld, job: Job, grip: Grip) -> Route:
    """Go up with the target, over the goal, down, open the fingers, and draw back."""
    high = job.floor_m + _TRAVEL_M
    lifted = np.array([*grip.position[:2], high])
    if job.goal is None:
        return (Waypoint(lifted, grip.angle, CLOSED, 0.01),)
    end = _release(world, job, grip)
    over = Waypoint(np.array([*end.position[:2], high]), end.angle, CLOSED, job.slack_m)
    down = Waypoint(end.position, end.angle, CLOSED, job.slack_m)
    release = Waypoint(end.position, end.angle, OPEN, math.inf, _OPEN_STEPS)
    leave = Waypoint(end.position + np.array([0.0, 0.0, 0.12]), end.angle, OPEN)
    aside = float(np.linalg.norm((end.position - grip.position)[:2]))
    if aside < 2 * job.slack_m and abs(end.angle - grip.angle) < _AT_RAD:
        return (down, release, leave)
    if grip.position[2] > high - 0.03:
        return (over, down, release, leave)
    return (Waypoint(lifted, grip.angle, CLOSED, 0.02), over, down, release, leave)


def _release(world: TaskWorld, job: Job, grip: Grip) -> Grip:
    """Return the pose of the hand when the target that it holds is at its goal."""
    assert job.goal is not None
    position, turn = world.pose(job.target)
    if not job.square:
        return Grip(job.goal(world) + grip.position - position, grip.angle)
    x, y, _ = rotations.rotate(rotations.quaternion(turn), (1.0, 0.0, 0.0))
    least = -math.remainder(math.atan2(y, x), _QUARTER)
    ends = [_turned(world, job, grip, least + step * _QUARTER) for step in (-1, 0, 1)]
    return min(ends, key=lambda end: _effort(world, end, grip))


def _turned(world: TaskWorld, job: Job, grip: Grip, yaw: float) -> Grip:
    """Return the pose of the hand when the target is at its goal, turned by an angle about the vertical."""
    assert job.goal is not None
    x, y, z = grip.position - world.position(job.target)
    c, s = math.cos(yaw), math.sin(yaw)
    return Grip(job.goal(world) + np.array([c * x - s * y, s * x + c * y, z]), grip.angle + yaw)


def _effort(world: TaskWorld, end: Grip, grip: Grip) -> float:
    """Return how far the hand turns, from where it is and from the middle of its range, and reaches."""
    base = world.data.body(world.arm.base_body).xpos
    reach = float(np.linalg.norm((end.position - base)[:2]))
    twist = abs(end.angle - shape_of(world.arm.name).neutral_rad)
    beyond = 1000 * max(0.0, twist - _WRIST_RAD) + 100 * max(0.0, reach - _EASY_REACH_M)
    return abs(end.angle - grip.angle) / 3 + twist + beyond


VERSION = 1
"""See :func:`.references.shipped_version`."""

policy = RobosuiteExpert
