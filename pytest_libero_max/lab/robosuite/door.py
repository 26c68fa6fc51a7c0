"""The expert's way with robosuite's door: turn its latch by the handle, and pull.

The handle is a flat bar, level while nobody holds it. The hand comes from in front of the door and closes its
fingers above and below the bar, as a person would; there is no room for a palm between bar and door. It then
rolls with the bar until the latch is out of the frame, and moves back along the arc of the door.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import Hand
from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.worlds.contract import Array

_HOLD_M = 0.1  # distance from the latch's axis at which the bar is held
_BAR_M = -0.1  # of the bar from the middle of the latch, along the latch's axis
_BEFORE_M = 0.12  # in front of the bar, where the hand turns towards it
_TURNED_RAD, _OPEN_RAD = 1.25, 0.38
_LATCH_STEP_RAD, _HINGE_STEP_RAD = 0.15, 0.06
_FREE_RAD = 0.04  # angle of the door from which the latch cannot fall back into the frame
_CLOSE_STEPS = 13
_AT_M = 0.016


@dataclass(frozen=True)
class _Door:
    """The door as it is now, world frame."""

    axis: Array
    """(3,) m: the latch's axis at the depth of the bar."""
    along: Array
    """(3,) unit vector from there to the free end of the bar."""
    into: Array
    """(3,) unit vector into the door, the direction of the latch's axis."""
    hinge: Array
    """(3,) m: a point of the hinge."""
    latch_rad: float
    hinge_rad: float


def open_door(world: TaskWorld, hand: Hand) -> Route:
    """Return the route to the open door."""
    door = _read(world)
    if world.fingers_on("Door") < len(world.arm.finger_joints):
        return _take(door, hand)
    if abs(door.latch_rad) < _TURNED_RAD and door.hinge_rad < _FREE_RAD:
        return _turn(door, hand)
    return _pull(door, hand)


def _read(world: TaskWorld) -> _Door:
    hinge, latch = world.data.joint("Door_hinge"), world.data.joint("Door_latch_joint")
    bar = world.data.body("Door_latch")
    frame = bar.xmat.reshape(3, 3)
    return _Door(
        axis=bar.xpos + _BAR_M * frame[:, 1],
        along=frame[:, 0].copy(),
        into=frame[:, 1].copy(),
        hinge=hinge.xanchor.copy(),
        latch_rad=float(latch.qpos[0]),
        hinge_rad=float(hinge.qpos[0]),
    )


def _around(into: Array, along: Array) -> Rotation:
    """Return the orientation of a hand that points into the door, its fingers above and below the bar."""
    fingers = np.cross(into, along)
    return Rotation.from_matrix(np.column_stack([fingers, np.cross(into, fingers), into]))


def _take(door: _Door, hand: Hand) -> Route:
    place, turn = door.axis + _HOLD_M * door.along, _around(door.into, door.along)
    close = Waypoint(place, 0.0, CLOSED, math.inf, _CLOSE_STEPS, exact=turn)
    reach = Waypoint(place, 0.0, OPEN, 0.005, exact=turn)
    before = Waypoint(place - _BEFORE_M * door.into, 0.0, OPEN, 0.015, exact=turn)
    off = hand.position - place
    ahead = -float(off @ door.into)
    aside = float(np.linalg.norm(off + ahead * door.into))
    askew = (turn * hand.turn.inv()).magnitude()
    if np.linalg.norm(off) < _AT_M and askew < 0.3:
        return (close,)
    if askew < 0.4 and aside < 0.015 + 0.3 * max(0.0, ahead):
        return (reach, close)
    return (before, reach, close)


def _turn(door: _Door, hand: Hand) -> Route:
    """Roll with the bar about the latch's axis."""
    return tuple(
        _turned(hand, door.axis, door.into * step * _LATCH_STEP_RAD, hand.turn) for step in range(1, 5)
    )


def _pull(door: _Door, hand: Hand) -> Route:
    """Move along the arc of the door, turning with it."""
    up = np.array([0.0, 0.0, 1.0])
    left = max(0.02, _OPEN_RAD - door.hinge_rad)
    turns = [min(step * _HINGE_STEP_RAD, left) for step in range(1, 6)]
    return tuple(_turned(hand, door.hinge, up * turn, hand.turn) for turn in turns)


def _turned(hand: Hand, about: Array, vector: Array, turn: Rotation) -> Waypoint:
    rotation = Rotation.from_rotvec(vector)
    return Waypoint(about + rotation.apply(hand.position - about), 0.0, CLOSED, 0.02, exact=rotation * turn)
