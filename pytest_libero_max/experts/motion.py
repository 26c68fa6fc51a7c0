"""Following a route: the actions that move the hand along waypoints, and a prediction of what each one does.

An action is relative to where the hand is when the action starts, so a policy that returns several at once
must predict where each of them ends. The controller pulls the hand towards its goal like a critically damped
spring, and sets a new goal every control step. It scales the pull on the position and that on the orientation
separately, so they disturb each other, and in an outstretched pose they nearly cancel along one direction.
All of that is linear, so the prediction is a matrix exponential.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from pytest_libero_max.experts.scene_view import Hand
from pytest_libero_max.worlds.rotations import Quaternion, composed, inverse, of_vector, vector_of

Array = NDArray[np.float64]

OPEN, CLOSED = -1.0, 1.0
_LIMIT = np.array([0.05] * 3 + [0.5] * 3)  # what an action of 1 asks for, m and rad
_LIMIT.setflags(write=False)
_PERIOD_S = 0.05
_STIFFNESS = 150.0
_DAMPING = 2 * math.sqrt(_STIFFNESS)
# The speed to aim at for each m or rad of error, and its limit: that of an arm whose axes are independent.
_GAIN, _TOP_SPEED = 8.0, np.array([0.25] * 3 + [2.5] * 3)
_TOP_SPEED.setflags(write=False)
_WEIGHT = np.array([1.0] * 3 + [0.1] * 3)  # 0.1 rad/s is as bad as 1 cm/s
_WEIGHT.setflags(write=False)
_DAMPING_OF_INVERSE = 1e-4  # keeps actions small in directions in which the hand hardly responds


@dataclass(frozen=True)
class Waypoint:
    """A pose of the hand on a route."""

    position: Array
    """(3,) m, world."""
    angle: float
    """Horizontal direction of the finger axis before the tilt, rad."""
    grip: float
    """``OPEN`` or ``CLOSED``."""
    tolerance_m: float = 0.005
    """Distance at which the waypoint counts as reached; ten times that in rad."""
    wait: int = 0
    """Control steps to stay."""
    tilt: float = 0.0
    """Angle between the fingers and straight down, rad."""
    heading: float = 0.0
    """Horizontal direction towards which the hand is tilted, rad."""
    exact: Rotation | None = None
    """The orientation of the hand, in place of the three angles."""

    @property
    def turn(self) -> Rotation:
        """Orientation of the hand."""
        return self.exact or hand_orientation(self.angle, self.tilt, self.heading)


@lru_cache(maxsize=64)
def hand_orientation(angle: float, tilt: float, heading: float) -> Rotation:
    """Orientation of a hand that was turned to ``angle`` and then tilted towards ``heading``."""
    c, s = math.cos(angle), math.sin(angle)
    down = Rotation.from_matrix(np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]]))
    return Rotation.from_rotvec(tilt * np.array([math.sin(heading), -math.cos(heading), 0.0])) * down


Route = tuple[Waypoint, ...]


def follow(hand: Hand, route: Route, steps: int) -> tuple[Array, list[Route]]:
    """Return the (steps, 7) actions along a route, the last waypoint of which is held, and the rest of it."""
    move_d, speed_d, move_v, speed_v = _response(hand.coupling)
    reply = _WEIGHT[:, None] * speed_d * _LIMIT
    answer = np.linalg.solve(reply.T @ reply + _DAMPING_OF_INVERSE * np.eye(6), reply.T) * _WEIGHT
    position, velocity = hand.position, np.concatenate([hand.velocity, hand.spin])
    turn, turns = _quaternion(hand.turn), [_quaternion(waypoint.turn) for waypoint in route]
    actions, left = [], []
    for _ in range(steps):
        while True:
            waypoint = route[0]
            rest = vector_of(composed(turns[-len(route)], inverse(turn)))
            error = np.array([*(waypoint.position - position).tolist(), *rest])
            far = max(np.linalg.norm(error[:3]), np.linalg.norm(error[3:]) / 10)
            if far >= waypoint.tolerance_m or waypoint.wait or len(route) == 1:
                break
            route = route[1:]
        if far < waypoint.tolerance_m and waypoint.wait:
            route = (replace(waypoint, wait=waypoint.wait - 1), *route[1:])
        wanted = _within(_GAIN * error, _TOP_SPEED)
        action = _within(answer @ (wanted - speed_v @ velocity), np.ones(6))
        actions.append(np.append(action, waypoint.grip))
        left.append(route)
        moved = move_d @ (action * _LIMIT) + move_v @ velocity
        velocity = speed_d @ (action * _LIMIT) + speed_v @ velocity
        position, turn = position + moved[:3], composed(of_vector(moved[3:].tolist()), turn)
    return np.array(actions), left


def _quaternion(turn: Rotation) -> Quaternion:
    x, y, z, w = turn.as_quat().tolist()
    return w, x, y, z


def _response(coupling: Array) -> tuple[Array, Array, Array, Array]:
    """Way and speed (m, then rad) by one control step, of each unit of the goal, then of the speed before."""
    zero, one = np.zeros((6, 6)), np.eye(6)
    pull, brake = _STIFFNESS * coupling, _DAMPING * coupling
    flow = expm(np.block([[zero, one, zero], [-pull, -brake, pull], [zero, zero, zero]]) * _PERIOD_S)
    return flow[:6, 12:], flow[6:12, 12:], flow[:6, 6:12], flow[6:12, 6:12]


def _within(vector: Array, limit: Array) -> Array:
    """Return the vector, scaled down until no component exceeds its limit."""
    return vector / max(1.0, float(np.max(np.abs(vector) / limit)))
