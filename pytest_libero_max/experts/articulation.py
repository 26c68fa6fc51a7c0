"""Opening and closing drawers and doors, and turning knobs.

Each skill is a route from the situation as it is: where the hand is relative to the part tells what comes
next, so that nothing has to be remembered.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.grasp import FINGERTIP_M, Grasp
from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint
from pytest_libero_max.experts.pick_and_place import (
    BERTH_M,
    CLEARANCE_M,
    CLOSING_STEPS,
    OPENING_STEPS,
    travel,
)
from pytest_libero_max.experts.scene_view import DRAWN_M, FACING, Boxes, Hand, Part, around, look_at_parts

Array = NDArray[np.float64]

_PULL_LEAN, _PUSH_LEAN = math.radians(88), math.radians(36)
_AROUND_M = 0.014  # the hand is at a part if it is nearer than that
_MARGIN_M, _MARGIN_RAD = 0.012, 0.35  # further than the goal asks
_RUN_UP_M, _TOUCH_M, _SAME_SPOT_M = 0.08, 0.025, 0.06
_DOOR_M = 0.20  # from the hinge, where a door is pushed
_FINGER_M = 0.012
_WIDE_RAD = -1.7  # a door that is opened further leaves room for the hand
_STEP_RAD = 0.2
_SHUT_M, _HELD_M = 0.004, 0.018  # openings between which the fingers hold a bar
_SLACK_M = 0.004  # wider than what they hold, by no more than this


def operate(world: Any, fact: Any, hand: Hand) -> Route:
    """The way to a drawer, door or knob in the state that a fact of the goal asks for."""
    (name, *_) = world.joints(fact.subject)
    part = next(part for part in look_at_parts(world) if part.joint == name)
    scene = around(world)
    q, joint = float(world.data.joint(name).qpos[0]), world.model.joint(name)
    low, high = (float(bound) for bound in joint.range)
    if fact.predicate in ("turnon", "turnoff"):
        target = 0.5 + _MARGIN_RAD if fact.predicate == "turnon" else low
        return _turn(hand, scene, part, target - q)
    slides = int(joint.type[0]) == 2
    if fact.predicate == "open":
        return _pull(hand, scene, part, (low + 0.002 if fact in world.goal else DRAWN_M) - q)
    if slides:
        return _push(hand, scene, part, high + _MARGIN_M - q)
    return sweep(world, part, high, hand)


def make_room(world: Any, owner: str, hand: Hand) -> Route:
    """The way to a door that is wide open; nothing if it is, or there is none."""
    if world.entities[owner].category != "microwave":
        return ()
    door = next(part for part in look_at_parts(world) if part.entity == owner and part.joint is not None)
    if float(world.data.joint(door.joint).qpos[0]) < _WIDE_RAD:
        return ()
    return sweep(world, door, _WIDE_RAD - _MARGIN_RAD, hand)


def _turn(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Grip the bar of a knob from above and turn the wrist."""
    across = np.cross(part.along, part.out)
    first = math.atan2(across[1], across[0])
    angles = [first + k * math.pi for k in range(-2, 3)]
    angle = min(angles, key=lambda a: max(abs(a - FACING), abs(a + way - FACING)))
    turned = Waypoint(part.position, angle + way, CLOSED, 0.005)
    let_go = Waypoint(part.position, angle + way, OPEN, math.inf, OPENING_STEPS)
    leave = Waypoint(part.position + 0.06 * part.out, angle + way, OPEN)
    end = (turned, let_go, leave)
    askew = abs(math.remainder(hand.angle - angle, math.pi))
    if _at(hand, part) and hand.opening < part.width + _SLACK_M and askew < 0.4:
        return end
    close = Waypoint(part.position, angle, CLOSED, math.inf, CLOSING_STEPS)
    grasp = Grasp(part.position, angle)
    if _at(hand, part) and askew < 0.2:
        return (close, *end)
    down = Waypoint(part.position, angle, OPEN, 0.004)
    return (*_over(hand, scene, grasp, OPEN), down, close, *end)


def _pull(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Grip the handle of a drawer from the front and pull."""
    heading = math.atan2(-part.out[1], -part.out[0])
    grasp = Grasp(part.position, _nearest(heading), _PULL_LEAN, heading)
    pulled = part.position + part.motion * way
    end = (
        _like(grasp, pulled, CLOSED, 0.004),
        _like(grasp, pulled, OPEN, math.inf, OPENING_STEPS),
        _like(grasp, pulled - 0.1 * grasp.axis, OPEN, 0.01),
    )
    if _at(hand, part) and _SHUT_M < hand.opening < _HELD_M:
        return end
    close = _like(grasp, part.position, CLOSED, math.inf, CLOSING_STEPS)
    if _at(hand, part) and abs(hand.lean - _PULL_LEAN) < 0.2 and hand.opening > _SHUT_M:
        return (close, *end)
    run_up = part.position - _RUN_UP_M * grasp.axis
    there = _like(grasp, part.position, OPEN, 0.004)
    off = hand.position - part.position
    ahead = -float(off @ grasp.axis)
    lined_up = float(np.linalg.norm(off + ahead * grasp.axis)) < 0.012 and abs(hand.lean - _PULL_LEAN) < 0.15
    if lined_up and -0.01 < ahead < _RUN_UP_M + 0.02 and hand.opening > 0.05:
        return (there, close, *end)
    before = Grasp(run_up, grasp.angle, grasp.lean, heading)
    return (*_over(hand, scene, before, OPEN), _like(grasp, run_up, OPEN, 0.006), there, close, *end)


def _push(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Push the handle of a drawer with closed fingers; leaning keeps the palm clear of what is above."""
    heading = math.atan2(-part.out[1], -part.out[0])
    tip = part.position + 0.006 * part.out
    grasp = Grasp(tip, _nearest(heading + math.pi / 2), _PUSH_LEAN, heading)
    push = _like(grasp, tip + part.motion * way, CLOSED, 0.002)
    before = Grasp(tip + _TOUCH_M * part.out, grasp.angle, grasp.lean, heading)
    off = hand.position - tip
    ahead = float(off @ part.out)
    lined_up = np.linalg.norm(off - ahead * part.out) < 0.02 and abs(hand.lean - _PUSH_LEAN) < 0.25
    if lined_up and ahead > -0.02 and hand.opening < 0.02:
        return (push,)
    return (*_over(hand, scene, before, CLOSED), _like(before, before.position, CLOSED, 0.006), push)


def sweep(world: Any, part: Part, target: float, hand: Hand) -> Route:
    """Sweep a door round: closed fingers go down beside its upper edge and follow the arc.

    Args:
        world: Where the door is.
        part: Its handle, which tells the outside from the inside.
        target: Joint position to bring it to, rad.
        hand: Where the hand is.
    """
    model, data = world.model, world.data
    joint = data.joint(part.joint)
    q, anchor = float(joint.qpos[0]), joint.xanchor[:2].copy()
    sense, out = math.copysign(1.0, joint.xaxis[2]), part.out[:2]
    mine = (model.geom_bodyid == model.joint(part.joint).bodyid[0]) & (model.geom_contype != 0)
    pane = max(np.flatnonzero(mine), key=lambda geom: float(np.prod(model.geom_size[geom])))
    middle = data.geom_xpos[pane][:2] - anchor
    along = middle - (middle @ out) * out
    along /= np.linalg.norm(along)
    side = 1.0 if (part.motion[:2] @ out) * (target - q) < 0 else -1.0
    touch = middle @ out + side * (min(model.geom_size[pane][:2]) + _FINGER_M)
    height = float(data.geom_xpos[pane][2] + model.geom_size[pane][2]) - 0.02

    def beside(angle: float, off: float) -> Array:
        turn = sense * (angle - q)
        x, y = _DOOR_M * along + off * out
        c, s = math.cos(turn), math.sin(turn)
        return np.array([anchor[0] + c * x - s * y, anchor[1] + s * x + c * y, height])

    offset = hand.position[:2] - anchor
    gap = side * float(offset @ out - touch)
    level = abs(hand.position[2] - height) < 0.025
    count = max(1, math.ceil(abs(target - q) / _STEP_RAD))
    stops = [q + (target - q) * (n + 1) / count for n in range(count - 1)]
    way = [Waypoint(beside(stop, touch - side * 0.015), FACING, CLOSED, 0.012) for stop in stops]
    end = (*way, Waypoint(beside(target, touch - side * 0.03), FACING, CLOSED, 0.002))
    if level and -0.02 < gap < 0.1 and abs(offset @ along - _DOOR_M) < 0.07 and hand.opening < 0.02:
        return end
    before = Grasp(beside(q, touch + side * 0.05), FACING)
    down = Waypoint(before.position, FACING, CLOSED, 0.01)
    contact = Waypoint(beside(q, touch), FACING, CLOSED, 0.01)
    return (*_over(hand, around(world), before, CLOSED), down, contact, *end)


def _at(hand: Hand, part: Part) -> bool:
    return bool(np.linalg.norm(hand.position - part.position) < _AROUND_M)


def _nearest(angle: float) -> float:
    """Of an angle of the finger axis and its opposite, the one nearer to the middle of the wrist's range."""
    return FACING + math.remainder(angle - FACING, math.pi)


def _over(hand: Hand, scene: Boxes, grasp: Grasp, grip: float) -> Route:
    """To above a pose, over everything in between."""
    height = scene.height_along(hand.position, grasp.position, BERTH_M) + CLEARANCE_M + FINGERTIP_M
    if np.linalg.norm((hand.position - grasp.position)[:2]) < _SAME_SPOT_M:
        height = max(hand.position[2], grasp.position[2])
    return travel(hand, grasp, max(height, grasp.position[2]), grip)


def _like(grasp: Grasp, position: Array, grip: float, tolerance_m: float, wait: int = 0) -> Waypoint:
    return Waypoint(position, grasp.angle, grip, tolerance_m, wait, grasp.lean, grasp.heading)
