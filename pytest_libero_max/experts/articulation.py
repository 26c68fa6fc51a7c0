"""Opening and closing drawers and doors, and turning knobs.

Each skill is a route from the present situation. The place of the hand relative to the part decides the next
move, so the expert needs no memory.
"""

from __future__ import annotations

import math

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
    waypoint_at,
)
from pytest_libero_max.experts.scene_view import (
    DRAWER_OPEN_M,
    WRIST_MIDDLE_RAD,
    Boxes,
    Hand,
    Part,
    obstacles,
    read_part,
    read_parts,
)
from pytest_libero_max.worlds.privileged import ExpertWorld, Fact

Array = NDArray[np.float64]

_PULL_TILT, _PUSH_TILT = math.radians(88), math.radians(36)
_AROUND_M = 0.014  # the hand is at a part if it is nearer than that
_MARGIN_M, _MARGIN_RAD = 0.012, 0.35  # how much further than the goal asks a joint is moved
_RUN_UP_M, _TOUCH_M, _SAME_SPOT_M = 0.08, 0.025, 0.06
_DOOR_M = 0.20  # distance from the hinge at which a door is pushed
_FINGER_M = 0.012
_WIDE_RAD = -1.7  # joint position of a door beyond which the hand has room to enter
_STEP_RAD = 0.2
_SHUT_M, _HELD_M = 0.004, 0.018  # openings between which the fingers hold a bar
_SLACK_M = 0.004  # fingers that hold a part are at most this much wider than it


def articulate(world: ExpertWorld, fact: Fact, hand: Hand) -> Route:
    """Return the route to a drawer, door or knob in the state that a fact of the goal asks for."""
    (name, *_) = world.joints(fact.subject)
    part = read_part(world, name)
    scene = obstacles(world)
    q, joint = float(world.data.joint(name).qpos[0]), world.model.joint(name)
    low, high = (float(bound) for bound in joint.range)
    if fact.predicate in ("turnon", "turnoff"):
        target = 0.5 + _MARGIN_RAD if fact.predicate == "turnon" else low
        return _turn_knob(hand, scene, part, target - q)
    slides = int(joint.type[0]) == 2
    if fact.predicate == "open":
        return _pull_drawer(hand, scene, part, (low + 0.002 if fact in world.goal else DRAWER_OPEN_M) - q)
    if slides:
        return _push_drawer(hand, scene, part, high + _MARGIN_M - q)
    return push_door(world, part, high, hand)


def open_door(world: ExpertWorld, owner: str, hand: Hand) -> Route:
    """Return the route that opens the door of a fixture wide; empty if it is open, or there is none."""
    if world.entities[owner].category != "microwave":
        return ()
    joints = (part.joint for part in read_parts(world) if part.entity == owner and part.joint is not None)
    door = read_part(world, next(joints, None))
    if float(world.data.joint(door.joint).qpos[0]) < _WIDE_RAD:
        return ()
    return push_door(world, door, _WIDE_RAD - _MARGIN_RAD, hand)


def _turn_knob(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Grip the bar of a knob from above and turn the wrist."""
    across = np.cross(part.along, part.out)
    first = math.atan2(across[1], across[0])
    angles = [first + k * math.pi for k in range(-2, 3)]
    angle = min(angles, key=lambda a: max(abs(a - WRIST_MIDDLE_RAD), abs(a + way - WRIST_MIDDLE_RAD)))
    turned = Waypoint(part.position, angle + way, CLOSED, 0.005)
    let_go = Waypoint(part.position, angle + way, OPEN, math.inf, OPENING_STEPS)
    leave = Waypoint(part.position + 0.06 * part.out, angle + way, OPEN)
    end = (turned, let_go, leave)
    askew = abs(math.remainder(hand.angle - angle, math.pi))
    if _is_at(hand, part) and hand.opening < part.width + _SLACK_M and askew < 0.4:
        return end
    close = Waypoint(part.position, angle, CLOSED, math.inf, CLOSING_STEPS)
    grasp = Grasp(part.position, angle)
    if _is_at(hand, part) and askew < 0.2:
        return (close, *end)
    down = Waypoint(part.position, angle, OPEN, 0.004)
    return (*_approach(hand, scene, grasp, OPEN), down, close, *end)


def _pull_drawer(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Grip the handle of a drawer from the front and pull."""
    heading = math.atan2(-part.out[1], -part.out[0])
    grasp = Grasp(part.position, _nearest_angle(heading), _PULL_TILT, heading)
    pulled = part.position + part.motion * way
    end = (
        waypoint_at(grasp, pulled, CLOSED, 0.004),
        waypoint_at(grasp, pulled, OPEN, math.inf, OPENING_STEPS),
        waypoint_at(grasp, pulled - 0.1 * grasp.axis, OPEN, 0.01),
    )
    if _is_at(hand, part) and _SHUT_M < hand.opening < _HELD_M:
        return end
    close = waypoint_at(grasp, part.position, CLOSED, math.inf, CLOSING_STEPS)
    if _is_at(hand, part) and abs(hand.tilt - _PULL_TILT) < 0.2 and hand.opening > _SHUT_M:
        return (close, *end)
    run_up = part.position - _RUN_UP_M * grasp.axis
    there = waypoint_at(grasp, part.position, OPEN, 0.004)
    off = hand.position - part.position
    ahead = -float(off @ grasp.axis)
    lined_up = float(np.linalg.norm(off + ahead * grasp.axis)) < 0.012 and abs(hand.tilt - _PULL_TILT) < 0.15
    if lined_up and -0.01 < ahead < _RUN_UP_M + 0.02 and hand.opening > 0.05:
        return (there, close, *end)
    before = Grasp(run_up, grasp.angle, grasp.tilt, heading)
    return (
        *_approach(hand, scene, before, OPEN),
        waypoint_at(grasp, run_up, OPEN, 0.006),
        there,
        close,
        *end,
    )


def _push_drawer(hand: Hand, scene: Boxes, part: Part, way: float) -> Route:
    """Push the handle of a drawer with closed fingers, tilted so that the palm clears the parts above it."""
    heading = math.atan2(-part.out[1], -part.out[0])
    tip = part.position + 0.006 * part.out
    grasp = Grasp(tip, _nearest_angle(heading + math.pi / 2), _PUSH_TILT, heading)
    push = waypoint_at(grasp, tip + part.motion * way, CLOSED, 0.002)
    before = Grasp(tip + _TOUCH_M * part.out, grasp.angle, grasp.tilt, heading)
    off = hand.position - tip
    ahead = float(off @ part.out)
    lined_up = np.linalg.norm(off - ahead * part.out) < 0.02 and abs(hand.tilt - _PUSH_TILT) < 0.25
    if lined_up and ahead > -0.02 and hand.opening < 0.02:
        return (push,)
    return (
        *_approach(hand, scene, before, CLOSED),
        waypoint_at(before, before.position, CLOSED, 0.006),
        push,
    )


def push_door(world: ExpertWorld, part: Part, target: float, hand: Hand) -> Route:
    """Push a door along its arc: closed fingers go down beside its upper edge and follow it."""
    model, data = world.model, world.data
    joint = data.joint(part.joint)
    q, anchor = float(joint.qpos[0]), joint.xanchor[:2].copy()
    sense, out = math.copysign(1.0, joint.xaxis[2]), part.out[:2]
    touchable = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    mine = (model.geom_bodyid == model.joint(part.joint).bodyid[0]) & touchable
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
    way = [Waypoint(beside(stop, touch - side * 0.015), WRIST_MIDDLE_RAD, CLOSED, 0.012) for stop in stops]
    end = (*way, Waypoint(beside(target, touch - side * 0.03), WRIST_MIDDLE_RAD, CLOSED, 0.002))
    if level and -0.02 < gap < 0.1 and abs(offset @ along - _DOOR_M) < 0.07 and hand.opening < 0.02:
        return end
    before = Grasp(beside(q, touch + side * 0.05), WRIST_MIDDLE_RAD)
    down = Waypoint(before.position, WRIST_MIDDLE_RAD, CLOSED, 0.01)
    contact = Waypoint(beside(q, touch), WRIST_MIDDLE_RAD, CLOSED, 0.01)
    return (*_approach(hand, obstacles(world), before, CLOSED), down, contact, *end)


def _is_at(hand: Hand, part: Part) -> bool:
    return bool(np.linalg.norm(hand.position - part.position) < _AROUND_M)


def _nearest_angle(angle: float) -> float:
    """Return the angle of the finger axis or its opposite, the one nearer the middle of the wrist's range."""
    return WRIST_MIDDLE_RAD + math.remainder(angle - WRIST_MIDDLE_RAD, math.pi)


def _approach(hand: Hand, scene: Boxes, grasp: Grasp, grip: float) -> Route:
    """Return the route to above a pose, over everything in between."""
    height = scene.height_along(hand.position, grasp.position, BERTH_M) + CLEARANCE_M + FINGERTIP_M
    if np.linalg.norm((hand.position - grasp.position)[:2]) < _SAME_SPOT_M:
        height = max(hand.position[2], grasp.position[2])
    return travel(hand, grasp, max(height, grasp.position[2]), grip)
