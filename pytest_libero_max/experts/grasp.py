"""Choosing a grasp: two fingers around an object, or around its rim if it is too wide."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.motion import hand_orientation
from pytest_libero_max.experts.scene_view import WRIST_MIDDLE_RAD, View

Array = NDArray[np.float64]

FINGERTIP_M = 0.0095  # how far the fingers reach below the point between them
_PALM_M = 0.031  # how far the palm is above that point
_WIDEST_M = 0.072  # of the 0.08 between open fingers
_HOLD_M = 0.008  # how much of a finger must be on the object
_RIM_DEPTH_M = 0.015  # how far the fingers go down over a rim
_WALL_M = 0.0035  # half the thickness of its wall
_ROOM_M = 0.015  # a point of the hand that is nearer than that to something counts as crowded
_RIM_POINTS = 12
_EASY_REACH_M = 0.7  # horizontal distance from the base beyond which the arm is outstretched
TILT = math.radians(45)
"""Tilt of the hand to hold something by a handle at its side, rad."""
_ROUND = ("neck", "knob")  # parts that can be held from any side


@dataclass(frozen=True)
class Grasp:
    """A pose of the hand in which closing the fingers takes hold."""

    position: Array
    """(3,) m, world."""
    angle: float
    """Horizontal direction of the finger axis before the tilt, rad."""
    tilt: float = 0.0
    """Angle between the fingers and straight down, rad."""
    heading: float = 0.0
    """Horizontal direction towards which the hand is tilted, rad."""

    @property
    def axis(self) -> Array:
        """(3,) unit vector in which the fingers point."""
        level = math.sin(self.tilt)
        return np.array(
            [level * math.cos(self.heading), level * math.sin(self.heading), -math.cos(self.tilt)]
        )


def release_pose(view: View, grasp: Grasp) -> Grasp:
    """Return the pose of the hand when the object that it holds by a grasp is at its goal."""
    c, s = math.cos(view.turn), math.sin(view.turn)
    arm = grasp.position - view.position
    x, y = view.goal[:2] + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
    height = grasp.position[2] - view.target.low + view.goal[2] - 0.002
    # The hand does not fit into a deep receptacle: the target is dropped from its edge.
    height = max(height, view.receptacle.high + 0.01) if view.inside else height
    return Grasp(np.array([x, y, height]), grasp.angle + view.turn, grasp.tilt, grasp.heading)


def choose_grasp(view: View) -> Grasp:
    """Return the grasp of least cost: with room for the hand, little turning, and near the hand.

    Measuring the room takes longest and can only add to the cost. So the candidates are visited in the order
    of the rest of their cost, up to the first that costs more without it than the best one with it.
    """
    best, least = None, math.inf
    grasps = ((grasp, release_pose(view, grasp)) for grasp in _candidates(view))
    efforts = [(_cost(view, grasp, end), grasp, end) for grasp, end in grasps]
    for effort, grasp, end in sorted(efforts, key=itemgetter(0)):
        if effort >= least:
            break
        cost = _cost(view, grasp, end, _crowding_of(view, grasp, end))
        if cost < least:
            best, least = grasp, cost
    assert best is not None, "every target offers a grasp"
    return best


def _candidates(view: View) -> Iterator[Grasp]:
    """Grasps at the parts that are made to be held, or else around the object's box."""
    if view.entry_heading is not None:
        for part in view.parts:
            if abs(part.out[2]) < 0.3 and abs(part.along[2]) > 0.9:
                way = view.entry_heading
                yield from _both_wrist_angles(part.position, way + math.pi / 2, TILT, way)
    named = [part for part in view.parts if part.out[2] > 0.9]
    for part in named:
        across = np.cross(part.along, part.out)
        angle = math.atan2(across[1], across[0])
        yield from _both_wrist_angles(part.position, angle)
        if part.name.endswith(_ROUND):
            yield from _both_wrist_angles(part.position, angle + math.pi / 2)
    if not named:
        yield from _box_grasps(view)


def _box_grasps(view: View) -> Iterator[Grasp]:
    """Grasps of an object without parts, or one that has fallen over: across its box, or at its rim."""
    corners = view.target.corners.reshape(-1, 3)
    local = corners @ view.axes
    low, high = local.min(axis=0), local.max(axis=0)
    middle = view.axes @ ((low + high) / 2)
    upright = int(np.argmax(np.abs(view.axes[2])))
    sides = [k for k in range(3) if k != upright]
    top, bottom = view.target.high, view.target.low
    if min((high - low)[sides]) > _WIDEST_M:
        across = view.axes[:2, sides[0]]
        first, radius = math.atan2(across[1], across[0]), float((high - low)[sides].mean()) / 2 - _WALL_M
        height = max(top - _RIM_DEPTH_M, bottom + FINGERTIP_M + 0.002)
        for n in range(_RIM_POINTS):
            angle = first + 2 * math.pi * n / _RIM_POINTS
            rim = middle[:2] + radius * np.array([math.cos(angle), math.sin(angle)])
            yield from _both_wrist_angles(np.array([*rim, height]), angle)
        return
    height = max(top - _PALM_M + 0.004, bottom + FINGERTIP_M + 0.002)
    for k, along in (sides, sides[::-1]):
        if (high - low)[k] <= _WIDEST_M:
            across, angle = view.axes[:, along], math.atan2(view.axes[1, k], view.axes[0, k])
            spare = max(0.0, (high - low)[along] / 2 - _HOLD_M)
            for offset in (0.0, -spare / 2, spare / 2, -spare, spare):
                yield from _both_wrist_angles(np.array([*(middle + offset * across)[:2], height]), angle)


def _both_wrist_angles(
    position: Array, angle: float, tilt: float = 0.0, heading: float = 0.0
) -> Iterator[Grasp]:
    """Yield the grasp and the one turned by half a turn, as far as the wrist reaches."""
    for turn in (angle - math.pi, angle, angle + math.pi):
        if abs(turn - WRIST_MIDDLE_RAD) <= math.radians(95):
            yield Grasp(position, turn, tilt, heading)


def _cost(view: View, grasp: Grasp, end: Grasp, crowded: float = 0.0) -> float:
    """Return the cost of a grasp: its crowding, and how far the hand must turn, travel and reach."""
    turning = abs(grasp.angle - view.hand.angle) + abs(grasp.angle - WRIST_MIDDLE_RAD)
    twist = 5 * max(0.0, abs(end.angle - WRIST_MIDDLE_RAD) - math.radians(95))
    away = float(np.linalg.norm(grasp.position - view.hand.position))
    aside = float(np.linalg.norm((grasp.position - view.position)[:2]))
    reach = [float(np.linalg.norm((there.position - view.hand.base)[:2])) for there in (grasp, end)]
    stretch = sum(max(0.0, far - _EASY_REACH_M) for far in reach)
    lid = 100.0 if view.entry_heading is not None and not grasp.tilt else 0.0
    return crowded + turning / 3 + twist + 5 * away + 20 * aside + 20 * stretch + lid


def _crowding_of(view: View, grasp: Grasp, end: Grasp) -> float:
    """Return the crowding around the hand where it takes hold, twice, and where it lets go."""
    return 2 * crowding(view, grasp, True) + (0.0 if grasp.tilt else crowding(view, end, False))


def crowding(view: View, grasp: Grasp, taking: bool) -> float:
    """Return the number of points of the hand that would be inside other things; near ones count in part.

    The space between the fingers counts too where nothing is held yet (``taking``).
    """
    turn = hand_orientation(grasp.angle, grasp.tilt, grasp.heading).as_matrix()
    points = grasp.position + _hand_points(taking) @ turn.T
    near = [boxes.near(points, _ROOM_M) for boxes in (view.others, view.receptacle)]
    room = np.minimum(*(boxes.distance(points) for boxes in near))
    return float(np.maximum(0.0, 1.0 - room / _ROOM_M).sum())


@cache
def _hand_points(between: bool) -> Array:
    """(n, 3) m: points of the open hand at a grasp and behind it, in the frame of the hand."""
    finger = [(x, y, z) for x in (0.040, 0.052, 0.064) for y in (-0.01, 0.01) for z in (-0.009, 0.01, 0.03)]
    palm = [(x, y, 0.032) for x in np.linspace(0.0, 0.104, 7) for y in (-0.021, 0.0, 0.021)]
    back = [(x, y, 0.1) for x in np.linspace(0.0, 0.104, 7) for y in (-0.032, 0.032)]
    half = np.array(finger + palm + back)
    if between:
        half = np.concatenate([half, [(x, 0.0, z) for x in (0.012, 0.026) for z in (-0.009, 0.01)]])
    both = np.concatenate([half, half * np.array([-1.0, 1.0, 1.0])])
    turns = np.linspace(0.0, 2 * math.pi, 12, endpoint=False)
    wrist = [(0.05 * math.cos(turn), 0.05 * math.sin(turn), z) for turn in turns for z in (0.12, 0.15, 0.18)]
    points: Array = np.concatenate([both, both + np.array([0.0, 0.0, 0.06]), wrist])
    points *= np.array([1.0, -1.0, -1.0])
    return points
