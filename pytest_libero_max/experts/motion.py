"""Moving the hand along a route, and knowing in advance where each action will leave it.

An action is relative to where the hand is when the action starts, which a policy that returns several at once
has to foresee. The controller pulls the hand towards its goal like a critically damped spring, and sets the
goal anew every control step. It scales the pull on the position and that on the orientation separately, so
they disturb each other, and in an outstretched pose nearly cancel along one direction. All of that is linear.
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

Array = NDArray[np.float64]

OPEN, CLOSED = -1.0, 1.0
_LIMIT = np.array([0.05] * 3 + [0.5] * 3)  # what an action of 1 asks for, m and rad
_PERIOD_S = 0.05
_STIFFNESS = 150.0
_DAMPING = 2 * math.sqrt(_STIFFNESS)
# The speed to aim at, for each m or rad that is missing, and the highest: that of an arm without couplings.
_HASTE, _TOP_SPEED = 8.0, np.array([0.25] * 3 + [2.5] * 3)
_WEIGHT = np.array([1.0] * 3 + [0.1] * 3)  # 0.1 rad/s is as bad as 1 cm/s
_EFFORT = 1e-4  # no more than this is asked for in directions in which the hand hardly answers


@dataclass(frozen=True)
class Waypoint:
    """Where the hand should be.

    Attributes:
        position: (3,) m, world.
        angle: Of the finger axis, rad, while the hand points straight down.
        grip: ``OPEN`` or ``CLOSED``.
        tolerance_m: How near counts as there; ten times that in rad.
        wait: Control steps to stay.
        lean: How far from straight down the hand points, rad.
        heading: Horizontal direction in which it then points, rad.
        exact: The orientation of the hand, instead of the three angles.
    """

    position: Array
    angle: float
    grip: float
    tolerance_m: float = 0.005
    wait: int = 0
    lean: float = 0.0
    heading: float = 0.0
    exact: Rotation | None = None

    @property
    def turn(self) -> Rotation:
        return self.exact or pointing(self.angle, self.lean, self.heading)


@lru_cache(maxsize=64)
def pointing(angle: float, lean: float, heading: float) -> Rotation:
    """Orientation of a hand that was turned to ``angle`` and then leant over."""
    c, s = math.cos(angle), math.sin(angle)
    down = Rotation.from_matrix(np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]]))
    return Rotation.from_rotvec(lean * np.array([math.sin(heading), -math.cos(heading), 0.0])) * down


Route = tuple[Waypoint, ...]


def follow(hand: Hand, route: Route, steps: int) -> tuple[Array, list[Route]]:
    """Actions that bring the hand along a route.

    Args:
        hand: Where it is now.
        route: At least one waypoint; the last one is held for ever.
        steps: How many actions.

    Returns:
        (steps, 7) actions, and what is left of the route after each of them.
    """
    move_d, speed_d, move_v, speed_v = _response(hand.coupling)
    reply = _WEIGHT[:, None] * speed_d * _LIMIT
    answer = np.linalg.solve(reply.T @ reply + _EFFORT * np.eye(6), reply.T) * _WEIGHT
    position, turn, velocity = hand.position, hand.turn, np.concatenate([hand.velocity, hand.spin])
    actions, left = [], []
    for _ in range(steps):
        while True:
            waypoint = route[0]
            error = np.concatenate([waypoint.position - position, (waypoint.turn * turn.inv()).as_rotvec()])
            far = max(np.linalg.norm(error[:3]), np.linalg.norm(error[3:]) / 10)
            if far >= waypoint.tolerance_m or waypoint.wait or len(route) == 1:
                break
            route = route[1:]
        if far < waypoint.tolerance_m and waypoint.wait:
            route = (replace(waypoint, wait=waypoint.wait - 1), *route[1:])
        wanted = _shortened(_HASTE * error, _TOP_SPEED)
        action = _shortened(answer @ (wanted - speed_v @ velocity), np.ones(6))
        actions.append(np.append(action, waypoint.grip))
        left.append(route)
        moved = move_d @ (action * _LIMIT) + move_v @ velocity
        velocity = speed_d @ (action * _LIMIT) + speed_v @ velocity
        position, turn = position + moved[:3], Rotation.from_rotvec(moved[3:]) * turn
    return np.array(actions), left


def _response(coupling: Array) -> tuple[Array, Array, Array, Array]:
    """What one control step does, (6, 6) each: way and speed for each goal, then for each speed before."""
    zero, one = np.zeros((6, 6)), np.eye(6)
    pull, brake = _STIFFNESS * coupling, _DAMPING * coupling
    flow = expm(np.block([[zero, one, zero], [-pull, -brake, pull], [zero, zero, zero]]) * _PERIOD_S)
    return flow[:6, 12:], flow[6:12, 12:], flow[:6, 6:12], flow[6:12, 6:12]


def _shortened(vector: Array, limit: Array) -> Array:
    """The vector, made shorter until no component exceeds its limit: the direction stays."""
    return vector / max(1.0, float(np.max(np.abs(vector) / limit)))
