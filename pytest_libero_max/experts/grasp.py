"""Where to take hold of something from above: two fingers around it, or around its rim if it is too wide."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.motion import pointing
from pytest_libero_max.experts.scene_view import FACING, View

Array = NDArray[np.float64]

FINGERTIP_M = 0.0095  # how far the fingers reach below the point between them
_PALM_M = 0.031  # how far the palm is above that point
_WIDEST_M = 0.072  # of the 0.08 between open fingers
_HOLD_M = 0.008  # how much of a finger has to be on the object
_RIM_DEPTH_M, _WALL_M = 0.015, 0.0035
_ROOM_M = 0.015
_RIM_POINTS = 12
_EASY_REACH_M = 0.7
LEAN = math.radians(45)
_ROUND = ("neck", "knob")  # parts that can be held from any side


@dataclass(frozen=True)
class Grasp:
    """A pose of the hand in which closing the fingers takes hold.

    Attributes:
        position: (3,) m, world.
        angle: Of the finger axis, rad.
        lean: How far from straight down the hand points, rad.
        heading: Horizontal direction in which it then points, rad.
    """

    position: Array
    angle: float
    lean: float = 0.0
    heading: float = 0.0

    @property
    def axis(self) -> Array:
        """Unit vector in which the fingers point."""
        level = math.sin(self.lean)
        return np.array(
            [level * math.cos(self.heading), level * math.sin(self.heading), -math.cos(self.lean)]
        )


def destination(view: View, grasp: Grasp) -> Grasp:
    """Where the hand is when what it holds by a grasp is at the goal."""
    c, s = math.cos(view.turn), math.sin(view.turn)
    arm = grasp.position - view.position
    x, y = view.goal[:2] + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
    height = grasp.position[2] - view.target.low + view.goal[2] - 0.002
    # Into something deep the target falls the last bit, because the hand itself does not fit.
    height = max(height, view.receptacle.high + 0.01) if view.inside else height
    return Grasp(np.array([x, y, height]), grasp.angle + view.turn, grasp.lean, grasp.heading)


def choose(view: View) -> Grasp:
    """The grasp with room for the hand and little turning, near to where the hand is already.

    Looking for room takes longest. It can only add to the cost, so it ends with the first grasp that costs
    more without it than the best one with it.
    """
    best, least = None, math.inf
    efforts = [(_cost(view, grasp), grasp) for grasp in _candidates(view)]
    for effort, grasp in sorted(efforts, key=itemgetter(0)):
        if effort >= least:
            break
        cost = _cost(view, grasp, _crowds(view, grasp))
        if cost < least:
            best, least = grasp, cost
    assert best is not None, "every target offers a grasp"
    return best


def _candidates(view: View) -> Iterator[Grasp]:
    if view.frontal is not None:
        for part in view.parts:
            if abs(part.out[2]) < 0.3 and abs(part.along[2]) > 0.9:
                way = view.frontal
                yield from _both_ways(part.position, way + math.pi / 2, LEAN, way)
    named = [part for part in view.parts if part.out[2] > 0.9]
    for part in named:
        across = np.cross(part.along, part.out)
        angle = math.atan2(across[1], across[0])
        yield from _both_ways(part.position, angle)
        if part.name.endswith(_ROUND):
            yield from _both_ways(part.position, angle + math.pi / 2)
    if not named:
        yield from _plain(view)


def _plain(view: View) -> Iterator[Grasp]:
    """Grasps of something that names no parts, or has fallen over: across its box, or at its rim."""
    corners = view.target.corners().reshape(-1, 3)
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
            yield from _both_ways(np.array([*rim, height]), angle)
        return
    height = max(top - _PALM_M + 0.004, bottom + FINGERTIP_M + 0.002)
    for k, along in (sides, sides[::-1]):
        if (high - low)[k] <= _WIDEST_M:
            across, angle = view.axes[:, along], math.atan2(view.axes[1, k], view.axes[0, k])
            spare = max(0.0, (high - low)[along] / 2 - _HOLD_M)
            for offset in (0.0, -spare / 2, spare / 2, -spare, spare):
                yield from _both_ways(np.array([*(middle + offset * across)[:2], height]), angle)


def _both_ways(position: Array, angle: float, lean: float = 0.0, heading: float = 0.0) -> Iterator[Grasp]:
    """The grasp and the one half a turn further, as far as the wrist allows."""
    for turn in (angle - math.pi, angle, angle + math.pi):
        if abs(turn - FACING) <= math.radians(95):
            yield Grasp(position, turn, lean, heading)


def _cost(view: View, grasp: Grasp, crowds: float = 0.0) -> float:
    """What speaks against a grasp: how crowded it is where it begins and ends, and the effort."""
    end = destination(view, grasp)
    turning = abs(grasp.angle - view.hand.angle) + abs(grasp.angle - FACING)
    twist = 5 * max(0.0, abs(end.angle - FACING) - math.radians(95))
    away = float(np.linalg.norm(grasp.position - view.hand.position))
    aside = float(np.linalg.norm((grasp.position - view.position)[:2]))
    reach = [float(np.linalg.norm((there.position - view.hand.base)[:2])) for there in (grasp, end)]
    stretch = sum(max(0.0, far - _EASY_REACH_M) for far in reach)
    lid = 100.0 if view.frontal is not None and not grasp.lean else 0.0
    return crowds + turning / 3 + twist + 5 * away + 20 * aside + 20 * stretch + lid


def _crowds(view: View, grasp: Grasp) -> float:
    """How crowded it is around the hand at a grasp, and where that ends."""
    end = destination(view, grasp)
    return 2 * crowd(view, grasp, True) + (0.0 if grasp.lean else crowd(view, end, False))


def crowd(view: View, grasp: Grasp, taking: bool) -> float:
    """How much of the hand, and of what is between its fingers, would be inside or near of other things."""
    turn = pointing(grasp.angle, grasp.lean, grasp.heading).as_matrix()
    points = grasp.position + _hand_points(taking) @ turn.T
    near = [boxes.near(points, _ROOM_M) for boxes in (view.others, view.receptacle)]
    room = np.minimum(*(boxes.distance(points) for boxes in near))
    return float(np.maximum(0.0, 1.0 - room / _ROOM_M).sum())


@cache
def _hand_points(between: bool) -> Array:
    """(n, 3) m: points of the open hand at the grasp and behind it, in the frame of the hand.

    Args:
        between: Whether points between the fingers are wanted too.
    """
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
