"""The expert's way with robosuite's door: turn its latch with the handle, and pull.

The handle is a flat bar, level while nobody holds it. The hand comes from above and straddles it: one finger
between the bar and the door. Closed fingers hold the flat sides, about which the bar turns like a hinge, so
the hand stays upright while it lifts the free end, until the latch is out of the frame, and then moves back
along the arc of the door.
"""

from __future__ import annotations

import math

import numpy as np

from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import Hand
from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.worlds.contract import Array

_HOLD_M = 0.13  # distance from the latch's axis at which the bar is held: its end must fit under the palm
_ABOVE_M = 0.1
_TURNED_RAD, _OPEN_RAD = 1.25, 0.38
_STEP_RAD = 0.2
_CLOSE_STEPS = 13
_AT_M = 0.012


def open_door(world: TaskWorld, hand: Hand) -> Route:
    """Return the route to the open door."""
    hinge, latch = world.data.joint("Door_hinge"), world.data.joint("Door_latch_joint")
    bar = world.data.body("Door_latch")
    frame = bar.xmat.reshape(3, 3)
    centre = bar.xpos + frame @ np.array([0.0, -0.1, 0.0])
    along, normal = frame[:, 0], frame[:, 1]
    angle = math.atan2(normal[1], normal[0])
    angle = hand.angle + math.remainder(angle - hand.angle, math.pi)
    place = centre + _HOLD_M * along
    turned, opened = float(latch.qpos[0]), float(hinge.qpos[0])
    held = world.fingers_on("Door") == len(world.arm.finger_joints)
    if not held:
        return _take(world, hand, place, angle)
    out = float((hand.position - centre) @ along)
    if abs(turned) < _TURNED_RAD and opened < 0.05:
        return _lift(centre, world.data.body("Door_door").xmat.reshape(3, 3)[:, 0], along, out, hand)
    return _pull(hand, np.array(hinge.xanchor), opened)


def _take(world: TaskWorld, hand: Hand, place: Array, angle: float) -> Route:
    close = Waypoint(place, angle, CLOSED, math.inf, _CLOSE_STEPS)
    down = Waypoint(place, angle, OPEN, 0.004)
    off = hand.position - place
    if np.linalg.norm(off) < _AT_M:
        return (close,)
    if np.linalg.norm(off[:2]) < 0.01 + 0.25 * max(0.0, off[2]):
        return (down, close)
    over = Waypoint(place + np.array([0.0, 0.0, _ABOVE_M]), angle, OPEN, 0.01)
    if off[2] > 0.05:
        return (over, down, close)
    back = Waypoint(np.array([*hand.position[:2], place[2] + _ABOVE_M]), hand.angle, OPEN, 0.03)
    return (back, over, down, close)


def _lift(centre: Array, level: Array, along: Array, out: float, hand: Hand) -> Route:
    """Turn the bar upwards about the latch's axis; ``level`` is its direction while nobody holds it."""
    now = math.atan2(along[2], float(along @ level))
    route = []
    for step in range(1, 8):
        ahead = min(now + step * _STEP_RAD, _TURNED_RAD + 0.2)
        spot = centre + out * (math.cos(ahead) * level + math.sin(ahead) * np.array([0.0, 0.0, 1.0]))
        route.append(Waypoint(spot, hand.angle, CLOSED, 0.02))
    return tuple(route)


def _pull(hand: Hand, hinge: Array, opened: float) -> Route:
    """Move the hand along the arc of the door, turning with it."""
    route = []
    for step in range(1, 6):
        turn = min(0.08 * step, max(0.02, _OPEN_RAD - opened))
        c, s = math.cos(turn), math.sin(turn)
        x, y, z = hand.position - hinge
        spot = hinge + np.array([c * x - s * y, s * x + c * y, z])
        route.append(Waypoint(spot, hand.angle + turn, CLOSED, 0.02))
    return tuple(route)
