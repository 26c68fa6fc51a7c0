"""Getting the hand away from what it has just used."""

from __future__ import annotations

import math
from typing import Any

from pytest_libero_max.experts.motion import OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import Hand, around, look_at_parts

_LEANING_RAD = 0.3
_NEAR_M = 0.03
_BACK_M = 0.1
_OPENING_STEPS = 6


def disengage(world: Any, fact: Any, hand: Hand) -> Route:
    """Open the fingers and draw back along them; nothing to do unless the hand leans at something.

    A hand that points straight down leaves upwards anyway.
    """
    joints = world.joints(fact.subject) if fact.place is None else ()
    parts = [
        part
        for part in look_at_parts(world)
        if part.joint not in joints and (fact.place is None or part.entity != fact.subject)
    ]
    axes = hand.turn.as_matrix()
    for part in parts:
        x, y, z = axes.T @ (part.position - hand.position)
        if abs(x) < 0.045 and abs(y) < 0.03 and -0.03 < z < 0.03 and (hand.lean > _LEANING_RAD):
            break
    else:
        tip = hand.position + 0.02 * hand.points
        near = around(world, fact.subject).distance(tip[None])[0] < _NEAR_M
        if hand.lean < _LEANING_RAD or not near or fact.place is None:
            return ()
    back = hand.position - _BACK_M * hand.points
    leave = Waypoint(back, hand.angle, OPEN, exact=hand.turn)
    if hand.opening > 0.05:
        return (leave,)
    return (Waypoint(hand.position, hand.angle, OPEN, math.inf, _OPENING_STEPS, exact=hand.turn), leave)
