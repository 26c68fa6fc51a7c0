"""A reference policy that sees: it finds target and destination in the image, and brings one to the other.

It is not privileged. It reads the image of the main camera, the pose of the hand and the opening of the
fingers, and has the knowledge that demonstrations of LIBERO-Object and LIBERO-Spatial would give it
(:mod:`.servo_scenes`): a changed camera, light, texture or noise can mislead it.

At every query it looks for target and destination, unless its own hand covers them, and continues
its route; where one of them has moved, it plans the rest of the route anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pytest_libero_max.experts.grasp import FINGERTIP_M
from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint, follow
from pytest_libero_max.experts.pick_and_place import CLEARANCE_M, CLOSING_STEPS, OPENING_STEPS
from pytest_libero_max.experts.scene_view import WRIST_MIDDLE_RAD, Hand
from pytest_libero_max.lab.servo.servo_scenes import (
    BOWL,
    BOWL_PLACES,
    BOWL_REACH_M,
    CAMERA,
    FLOOR_AREA,
    GRIP_ANGLES_RAD,
    GROCERIES,
    IMAGE_SIZE,
    SCENES,
    SHAPES,
    SceneKnowledge,
)
from pytest_libero_max.lab.servo.sight import Area, Shape, chances, find, overlap
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation

Array = NDArray[np.float64]

_NOWHERE = np.full(3, np.inf)
_NOWHERE.setflags(write=False)
_MOVED_M = 0.01  # a thing that is seen farther than this from where the route leads has moved
_FOLLOW_M = 0.14  # how far a thing may move between two looks
_LEASH = 1.5  # how much score a thing must gain for each m that it is seen to have moved
_COVERED = 0.15  # part of a thing that the hand's outline may cover before it cannot be judged
_NOTHING_M = 0.003  # opening below which the fingers hold nothing
_PALM_M = 0.027  # how far the palm stays above what is held by its top
_RIM_M = 0.0035  # from the outside of a rim to the middle of its wall
_RIM_DEPTH_M = 0.015  # how far below a rim it is held
_WIDEST_M = 0.072
_ABOVE_M = 0.015  # horizontal distance within which the hand is above its goal
_ARRIVED_M = 0.02
_ON_TOP_M, _OVER_RIM_M = 0.004, 0.015
_HAND_M = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (-0.03, 0.03) for z in (-0.14, 0.0)])
"""(8, 3) m: corners of a box around palm and fingers, in the frame of the fingers."""
_HAND_M.setflags(write=False)
_FINGERS_ACROSS = Rotation.from_euler("z", -90, degrees=True)  # from the hand's frame to that of its fingers


@dataclass(frozen=True)
class Memory:
    """Memory from one query to the next."""

    target: Array | None = None
    """Last seen position of the object to bring, (3,) m, or None."""
    destination: Array | None = None
    """Likewise."""
    route: Route = ()
    """Rest of the route."""
    aim: tuple[Array, Array] = (_NOWHERE, _NOWHERE)
    """Positions of target and destination when the route was planned."""


class ServoPolicy:
    """Looks, plans a route where something has moved, and follows it."""

    spec = PolicySpec(
        "servo", horizon=10, query_interval=5, cameras=(CAMERA,), image_size=IMAGE_SIZE, suites=tuple(SCENES)
    )

    def reset(self, episode: Episode) -> None:
        """Forget everything; the world is not read."""
        self._scene = SCENES[episode.suite]
        self._memory = Memory()

    def predict(self, observation: Observation, query: Query) -> Array:
        hand = read_hand(observation)
        image = observation[f"{CAMERA}_image"][::-1]
        memory = act(self._scene, self._memory, image, hand, query.instruction)
        actions, left = follow(hand, memory.route, self.spec.horizon)
        self._memory = replace(memory, route=left[self.spec.query_interval - 1])
        return actions

    def snapshot(self) -> Memory:
        return self._memory

    def restore(self, memory: Memory) -> None:
        self._memory = memory


def read_hand(observation: Observation) -> Hand:
    """Return the hand, from proprioception alone: its speed is unknown, its axes count as independent."""
    left, right = (float(value) for value in observation["robot0_gripper_qpos"])
    return Hand(
        position=np.asarray(observation["robot0_eef_pos"], dtype=np.float64),
        turn=Rotation.from_quat(observation["robot0_eef_quat"]) * _FINGERS_ACROSS,
        velocity=np.zeros(3),
        spin=np.zeros(3),
        opening=left - right,
        base=np.zeros(3),
        coupling=np.eye(6),
    )


@dataclass(frozen=True)
class Wish:
    """Object that an instruction asks to bring."""

    category: str
    area: Area
    """Area in which to look for it."""
    angle: float
    """Horizontal direction of the finger axis when it is taken, rad."""

    @property
    def shape(self) -> Shape:
        """Outline of the object."""
        return SHAPES[self.category]

    @property
    def grip(self) -> Array:
        """(3,) m: from the middle of its foot to where the fingers close: at its middle, or at a wide rim."""
        if 2 * self.shape.radius <= _WIDEST_M:
            return np.array([0.0, 0.0, max(self.shape.height - _PALM_M, FINGERTIP_M + 0.002)])
        radius = self.shape.radius - _RIM_M
        rim = (radius * math.cos(self.angle), radius * math.sin(self.angle))
        return np.array([*rim, self.shape.height - _RIM_DEPTH_M])


def understand(scene: SceneKnowledge, instruction: str) -> Wish:
    """Object that an instruction asks to bring.

    Where it is not understood, that is the first grocery by name, or a bowl in the middle of the table.
    """
    text = instruction.lower().replace("_", " ")
    if scene.destination == "plate":
        words = next((words for words in BOWL_PLACES if words in text), "table center")
        area = Area.around(np.array(BOWL_PLACES[words]), BOWL_REACH_M)
        return Wish(BOWL, area, GRIP_ANGLES_RAD.get(words, WRIST_MIDDLE_RAD))
    named = [name for name in GROCERIES if name.replace("_", " ") in text]
    return Wish((named or GROCERIES)[0], FLOOR_AREA, WRIST_MIDDLE_RAD)


def act(
    scene: SceneKnowledge, memory: Memory, image: NDArray[np.uint8], hand: Hand, instruction: str
) -> Memory:
    """Return the objects seen now in an upright (256, 256, 3) image, and the route to follow from now on."""
    wish = understand(scene, instruction)
    route, target = memory.route, memory.target
    holding = bool(route) and route[0].grip == CLOSED
    waiting = holding and bool(route[0].wait)
    leaving = bool(route) and not any(waypoint.grip == CLOSED for waypoint in route)
    lost = holding and not waiting and hand.opening < _NOTHING_M
    replans = not route or lost or (leaving and _is_at_end(hand, route))
    destination = _look(scene, scene.destination, image, hand, memory.destination, scene.destination_area)
    if target is None or replans or not (holding or leaving):
        target = _look(scene, wish.category, image, hand, None if replans else target, wish.area)
    if replans or not (holding or leaving or _is_at(memory.aim, target, destination)):
        route = (
            *_pick(scene, hand, wish, target),
            *_place(scene, wish, target, destination, target + wish.grip),
        )
    elif holding and not waiting and not _is_at(memory.aim, memory.aim[0], destination):
        route = _place(scene, wish, target, destination, hand.position)
    else:
        return replace(memory, target=target, destination=destination)
    return Memory(target, destination, route, (target, destination))


def _look(
    scene: SceneKnowledge,
    category: str,
    image: NDArray[np.uint8],
    hand: Hand,
    before: Array | None,
    area: Area,
) -> Array:
    """Return the seen position of a thing; its position before, if the hand covers it."""
    shape = SHAPES[category]
    if before is not None:
        if covers(scene, hand, shape, before):
            return before
        area = Area.around(before, _FOLLOW_M)
    leash = 0.0 if before is None else _LEASH
    return find(chances(image, category), scene.camera, shape, area, leash).position


def covers(scene: SceneKnowledge, hand: Hand, shape: Shape, position: Array) -> bool:
    """Return True if the hand hides a thing in the image, or would if it were nearer to the camera."""
    body = hand.position + _HAND_M @ hand.turn.as_matrix().T
    thing = scene.camera.project(shape.points(position))
    return overlap(thing, scene.camera.project(body)) > _COVERED


def _is_at_end(hand: Hand, route: Route) -> bool:
    return len(route) == 1 and bool(np.linalg.norm(route[0].position - hand.position) < _ARRIVED_M)


def _is_at(aim: tuple[Array, Array], target: Array, destination: Array) -> bool:
    moves = [now - then for now, then in zip((target, destination), aim, strict=True)]
    return all(float(np.linalg.norm(move)) <= _MOVED_M for move in moves)


def _pick(scene: SceneKnowledge, hand: Hand, wish: Wish, target: Array) -> Route:
    """Up, over the target, down to it, and close the fingers; straight down from above it."""
    goal = target + wish.grip
    height = max(scene.clearance, float(target[2]) + wish.shape.height) + CLEARANCE_M + FINGERTIP_M
    way: Route = ()
    if float(np.linalg.norm((hand.position - goal)[:2])) > _ABOVE_M:
        way = (_waypoint(wish, np.array([*goal[:2], height]), OPEN, 0.01),)
        if hand.position[2] < height - 0.02:
            way = (_waypoint(wish, np.array([*hand.position[:2], height]), OPEN, 0.02), *way)
    return (*way, _waypoint(wish, goal, OPEN, 0.003), _waypoint(wish, goal, CLOSED, math.inf, CLOSING_STEPS))


def _place(scene: SceneKnowledge, wish: Wish, target: Array, destination: Array, start: Array) -> Route:
    """Up with the target, over the destination, down, open the fingers, and up again; (3,) m at the start."""
    hanging = float(wish.grip[2])
    low = hanging + _ON_TOP_M
    if scene.drop:
        low = max(low, SHAPES[scene.destination].height + _OVER_RIM_M)
    end = destination + np.array([*wish.grip[:2], low])
    height = max(scene.clearance, float(target[2])) + CLEARANCE_M + max(hanging, FINGERTIP_M)
    way: Route = ()
    if float(np.linalg.norm((start - end)[:2])) > _ABOVE_M:
        up, over = np.array([*start[:2], height]), np.array([*end[:2], height])
        way = (_waypoint(wish, up, CLOSED, 0.02), _waypoint(wish, over, CLOSED, 0.01))
    return (
        *way,
        _waypoint(wish, end, CLOSED, 0.006),
        _waypoint(wish, end, OPEN, math.inf, OPENING_STEPS),
        _waypoint(wish, end + np.array([0.0, 0.0, 0.1]), OPEN),
    )


def _waypoint(
    wish: Wish, position: Array, grip: float, tolerance_m: float = 0.005, wait: int = 0
) -> Waypoint:
    return Waypoint(position, wish.angle, grip, tolerance_m, wait)


VERSION = 1
"""See :func:`.references.shipped_version`."""

policy = ServoPolicy
