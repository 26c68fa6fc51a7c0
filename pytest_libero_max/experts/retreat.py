"""Retreat of the hand from a part or object that it has used."""

from __future__ import annotations

import math

from pytest_libero_max.experts.motion import OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import Hand, obstacles, read_parts
from pytest_libero_max.worlds.privileged import ExpertWorld, Fact

_TILTED_RAD = 0.3
_NEAR_M = 0.03
_BACK_M = 0.1
_OPENING_STEPS = 6
_BETWEEN_FINGERS_M = (0.045, 0.03, 0.03)  # half sizes of the space between open fingers, in the hand's frame


def retreat(world: ExpertWorld, fact: Fact, hand: Hand) -> Route:
    """Open the fingers and draw back along them, if the hand is tilted and still at a part or an obstacle.

    A hand that points straight down needs no retreat: every route begins upwards.

    Args:
        fact: The next subgoal. Entities that belong to it are no obstacles.

    Returns:
        The route; empty where no retreat is needed.
    """
    if hand.tilt <= _TILTED_RAD or not (_at_a_part(world, fact, hand) or _at_an_obstacle(world, fact, hand)):
        return ()
    back = hand.position - _BACK_M * hand.approach
    leave = Waypoint(back, hand.angle, OPEN, exact=hand.turn)
    if hand.opening > 0.05:
        return (leave,)
    return (Waypoint(hand.position, hand.angle, OPEN, math.inf, _OPENING_STEPS, exact=hand.turn), leave)


def _at_a_part(world: ExpertWorld, fact: Fact, hand: Hand) -> bool:
    """Return True if a handle or knob that the subgoal does not use is between the fingers."""
    joints = world.joints(fact.subject) if fact.place is None else ()
    axes = hand.turn.as_matrix()
    for part in read_parts(world):
        if part.joint in joints or (fact.place is not None and part.entity == fact.subject):
            continue
        off = axes.T @ (part.position - hand.position)
        if all(abs(way) < half for way, half in zip(off, _BETWEEN_FINGERS_M, strict=True)):
            return True
    return False


def _at_an_obstacle(world: ExpertWorld, fact: Fact, hand: Hand) -> bool:
    """Return True if the fingertips are near anything but the object that is to be brought."""
    if fact.place is None:
        return False
    tip = hand.position + 0.02 * hand.approach
    return bool(obstacles(world, fact.subject).distance(tip[None])[0] < _NEAR_M)
