"""Pick and place: picking an object up and putting it onto or into something else.

An object that enters a receptacle from the front is held by its handle, with a tilted hand that can push it
in. Where the handle cannot be reached, the object is taken by its rim, turned and put down once before.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.grasp import FINGERTIP_M, TILT, Grasp, choose_grasp, crowding, release_pose
from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import WRIST_MIDDLE_RAD, Boxes, Hand, Part, View

Array = NDArray[np.float64]

CLEARANCE_M = 0.025  # between the lowest point of what is carried and the highest point below it
BERTH_M = 0.09  # half the width of the hand with what it carries
CLOSING_STEPS, OPENING_STEPS = 13, 8
_NEARBY_M = 0.04  # horizontal distance below which the hand goes straight to its target
_SHUT_M = 0.002  # the opening below which the fingers hold nothing
_OPEN_M = 0.07  # the opening above which they fit around something
_WIDTH_M = 0.06  # half the width of what enters a receptacle from the front
_RUN_UP_M = 0.2  # distance in front of such a receptacle from which it is entered
_LIFT_M = 0.04
_HALF_TURN_RAD = 2.4  # a turn beyond this counts as half a turn
_DRIFT_M = 0.03  # horizontal error that is corrected on the way down
_STUCK_M = 0.04  # height above the goal below which a hand that does not sink opens


def pick_and_place(view: View) -> Route:
    """Return the route to the target standing at its goal and the hand above it."""
    hand = view.hand
    if view.held:
        heading = 0.0 if view.entry_heading is None else view.entry_heading
        tilt = hand.tilt if view.entry_heading is not None and hand.tilt > 0.3 else 0.0
        return _place(view, Grasp(hand.position, _wrist(hand, tilt, heading), tilt, heading))
    grasp = choose_grasp(view)
    return (*_pick(view, grasp), *_place(view, grasp))


def _wrist(hand: Hand, tilt: float, heading: float) -> float:
    """Return the angle of the hand before its tilt."""
    if not tilt:
        return hand.angle
    level = hand.turn.as_matrix()[:, 0]  # the finger axis, which a tilt across it leaves alone
    return 0.0 if level[0] > 0 else math.pi


def _pick(view: View, grasp: Grasp) -> Route:
    """Go up, over the target, down to it, and close the fingers."""
    hand, goal = view.hand, grasp.position
    close = waypoint_at(grasp, goal, CLOSED, math.inf, CLOSING_STEPS)
    down = waypoint_at(grasp, goal, OPEN, 0.003)
    if np.allclose(hand.position, goal, rtol=0, atol=0.005) and hand.opening > _SHUT_M:
        return (close,)
    if hand.opening > _OPEN_M and _in_funnel(hand, grasp):
        return (down, close)
    everything = (view.others, view.receptacle, view.target)
    height = max(boxes.height_along(hand.position, goal, BERTH_M) for boxes in everything)
    height = max(height + CLEARANCE_M + FINGERTIP_M, goal[2] + 0.05)
    if np.linalg.norm((hand.position - goal)[:2]) < _NEARBY_M:
        height = min(height, max(hand.position[2], view.target.high + FINGERTIP_M + 0.01))
    if grasp.tilt:
        run_up = goal - 0.09 * grasp.axis
        above = Grasp(run_up, grasp.angle, grasp.tilt, grasp.heading)
        return (*travel(hand, above, height, OPEN), waypoint_at(grasp, run_up, OPEN), down, close)
    return (*travel(hand, grasp, height, OPEN), down, close)


def _in_funnel(hand: Hand, grasp: Grasp) -> bool:
    """Return True if the hand is in a funnel above the grasp, which is wider the further up."""
    off = hand.position - grasp.position
    height = -float(off @ grasp.axis)
    aside = float(np.linalg.norm(off + height * grasp.axis))
    askew = abs(math.remainder(hand.angle - grasp.angle, math.pi)) + abs(hand.tilt - grasp.tilt)
    return (
        -0.01 < height < 0.12 + (0.0 if grasp.tilt else 1.0)
        and askew < 0.15
        and aside < min(0.006 + 0.2 * height, 0.02)
    )


def _place(view: View, grasp: Grasp) -> Route:
    """Go up with the target, over the goal, down, open the fingers, and draw back."""
    hand, start, end = view.hand, grasp.position, release_pose(view, grasp)
    hanging = start[2] - view.target.low
    down = waypoint_at(end, end.position, CLOSED, 0.008)
    release = waypoint_at(end, end.position, OPEN, math.inf, OPENING_STEPS)
    leave = waypoint_at(end, end.position - 0.1 * end.axis, OPEN)
    way = float(np.linalg.norm((end.position - start)[:2]))
    if view.entry_heading is not None and grasp.tilt:
        return (*_insert(view, grasp, end), down, release, leave)
    if view.held and way < _DRIFT_M and abs(view.turn) < 0.1 and start[2] > end.position[2] - 0.01:
        if start[2] < end.position[2] + _STUCK_M and _stuck(hand):
            here = waypoint_at(grasp, start, OPEN, math.inf, OPENING_STEPS)
            return (here, waypoint_at(grasp, start - 0.1 * grasp.axis, OPEN))
        return (down, release, leave)
    height = max(boxes.height_along(start, end.position, BERTH_M) for boxes in (view.others, view.receptacle))
    height = max(height + CLEARANCE_M + max(hanging, FINGERTIP_M), start[2] + (0.0 if view.held else _LIFT_M))
    return (*travel(grasp, end, height, CLOSED), down, release, leave)


def _stuck(hand: Hand) -> bool:
    """Return True if something holds the hand up: it does not sink, though it may still slide a little."""
    return bool(abs(hand.velocity[2]) < 0.005 and np.linalg.norm(hand.velocity) < 0.04)


def _insert(view: View, grasp: Grasp, end: Grasp) -> Route:
    """Go in front of the opening, then level into it."""
    into = np.array([math.cos(end.heading), math.sin(end.heading), 0.0])
    level = end.position + np.array([0.0, 0.0, 0.012])
    off = grasp.position - level
    ahead = float(off @ into)
    if view.held and ahead > -_RUN_UP_M and np.linalg.norm(off - ahead * into) < 0.02:
        return (waypoint_at(end, level, CLOSED),)
    before = level - _RUN_UP_M * into
    up = np.array([*grasp.position[:2], max(grasp.position[2], before[2])])
    in_there = (waypoint_at(end, before, CLOSED, 0.01), waypoint_at(end, level, CLOSED))
    way = before - grasp.position
    over = view.others.height_along(view.position, view.position + way, _WIDTH_M)
    over += CLEARANCE_M + grasp.position[2] - view.target.low
    if over < before[2] or np.linalg.norm(way[:2]) < _NEARBY_M:
        return (waypoint_at(grasp, up, CLOSED, 0.015), *in_there)
    up[2] = max(up[2], over)
    return (
        waypoint_at(grasp, up, CLOSED, 0.015),
        waypoint_at(end, np.array([*before[:2], over]), CLOSED, 0.01),
        *in_there,
    )


def waypoint_at(
    grasp: Grasp, position: Array, grip: float, tolerance_m: float = 0.005, wait: int = 0
) -> Waypoint:
    """Return a waypoint at a position with the orientation of a grasp."""
    return Waypoint(position, grasp.angle, grip, tolerance_m, wait, grasp.tilt, grasp.heading)


def travel(start: Hand | Grasp, end: Grasp, height: float, grip: float) -> Route:
    """Go up to a height in m, unless already there, and at that height to above the end."""
    # Half a turn could go either way: it must go through the middle of the wrist's range.
    angle = end.angle if abs(end.angle - start.angle) < _HALF_TURN_RAD else WRIST_MIDDLE_RAD
    over = waypoint_at(replace(end, angle=angle), np.array([*end.position[:2], height]), grip, 0.01)
    if start.position[2] > height - 0.02:
        return (over,)
    up = np.array([*start.position[:2], height])
    if isinstance(start, Grasp):
        return (waypoint_at(start, up, grip, 0.02), over)
    return (Waypoint(up, start.angle if start.tilt < 0.2 else end.angle, grip, 0.02), over)


# Where it can be put down, relative to the goal, m: in front of the door, and to the right.
_SPOTS_M = tuple((before, aside) for before in (0.344, 0.4, 0.46) for aside in (0.0, 0.05, -0.05, 0.1, -0.1))
_FREE_M = 0.07  # distance from its middle to anything else
_REACH_M = (0.55, 0.72)  # horizontal distance from the base at which a tilted hand can work
_SPARE_M = 0.015  # margin to both, because it will not stand exactly where it was planned
_MOST_CROWDED = 3.0  # a handle with more crowding cannot be reached
_ASKEW_RAD = 0.35
_NOTHING = Boxes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
_BY_HANDLE_RAD = 0.3  # a hand that is tilted further holds the object by its handle


def with_regrasp(view: View) -> View:
    """Return the view of the next step: the view itself, or one whose goal is a place for a regrasp.

    A regrasp is needed for an object that enters its receptacle from the front and whose handle cannot be
    reached from there. Where no place for it is free, the view is returned unchanged.
    """
    handle = _handle(view)
    if view.entry_heading is None or handle is None or (view.held and view.hand.tilt > _BY_HANDLE_RAD):
        return view
    outwards = math.remainder(view.entry_heading + math.pi, 2 * math.pi)
    turn = math.remainder(outwards - math.atan2(handle.out[1], handle.out[0]), 2 * math.pi)
    if not view.held and abs(turn) < _ASKEW_RAD and _reachable(view, handle.position):
        return view
    if view.held and abs(view.hand.angle + turn - WRIST_MIDDLE_RAD) > math.pi:
        turn -= math.copysign(2 * math.pi, turn)  # the wrist turns the other way
    spot = _free_spot(view, view.entry_heading, handle)
    if spot is None:
        return view
    return replace(
        view,
        goal=spot,
        inside=False,
        entry_heading=None,
        turn=turn,
        receptacle=_NOTHING,
        others=_joined(view.others, view.receptacle),
    )


def _free_spot(view: View, entry_heading: float, handle: Part) -> Array | None:
    """(3,) m: where its origin can be put with the handle away from the door; None if nothing is free."""
    into = np.array([math.cos(entry_heading), math.sin(entry_heading)])
    right = np.array([into[1], -into[0]])
    ground = view.receptacle.low
    height = ground + handle.position[2] - view.target.low
    off = float(np.linalg.norm((handle.position - view.position)[:2]))
    for before, aside in _SPOTS_M:
        x, y = view.goal[:2] - before * into + aside * right
        free = view.others.distance(np.array([[x, y, height]]))[0] > _FREE_M
        end = np.array([x - off * into[0], y - off * into[1], height])
        if free and _reachable(view, end, _SPARE_M):
            return np.array([x, y, ground])
    return None


def _reachable(view: View, position: Array, spare_m: float = 0.0) -> bool:
    """Return True if a tilted hand has room around a handle, and the arm reaches it."""
    assert view.entry_heading is not None
    grasp = Grasp(position, view.entry_heading + math.pi / 2, TILT, view.entry_heading)
    far = float(np.linalg.norm((position - view.hand.base)[:2]))
    within = _REACH_M[0] + spare_m < far < _REACH_M[1] - spare_m
    return within and crowding(view, grasp, taking=True) < _MOST_CROWDED


def _handle(view: View) -> Part | None:
    """Return the handle at the side of the target, if the target stands upright."""
    sideways = (part for part in view.parts if abs(part.out[2]) < 0.3 and abs(part.along[2]) > 0.9)
    return next(sideways, None)


def _joined(first: Boxes, second: Boxes) -> Boxes:
    pairs = ((first.centre, second.centre), (first.turn, second.turn), (first.half, second.half))
    centre, turn, half = (np.concatenate(pair) for pair in pairs)
    return Boxes(centre, turn, half)
