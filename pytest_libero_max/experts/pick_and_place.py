"""Picking something up and putting it on or into something else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.grasp import FINGERTIP_M, Grasp, choose, destination
from pytest_libero_max.experts.motion import CLOSED, OPEN, Route, Waypoint
from pytest_libero_max.experts.scene_view import FACING, Hand, View

Array = NDArray[np.float64]

CLEARANCE_M = 0.025  # between the lowest point of what travels and the highest of what it travels over
BERTH_M = 0.09  # half the width of what travels
CLOSING_STEPS, OPENING_STEPS = 13, 8
_NEARBY_M = 0.04  # horizontally, no travelling is needed below this
_SHUT_M, _OPEN_M = 0.002, 0.07  # openings at which the fingers hold nothing, and can go around something
_WIDTH_M = 0.06  # half the width of what goes in there
_RUN_UP_M = 0.2  # in front of what is entered from the front
_LIFT_M = 0.04
_HALF_TURN_RAD = 2.4  # nearly
_DRIFT_M = 0.03  # what is corrected on the way down
_STUCK_M = 0.04  # so near above its end a hand that does not sink lets go


def place(view: View) -> Route:
    """The way from here to the target standing at its goal and the hand above it."""
    hand = view.hand
    if view.held:
        heading = 0.0 if view.frontal is None else view.frontal
        lean = hand.lean if view.frontal is not None and hand.lean > 0.3 else 0.0
        return _bring(view, Grasp(hand.position, _wrist(hand, lean, heading), lean, heading))
    grasp = choose(view)
    return (*_reach(view, grasp), *_bring(view, grasp))


def _wrist(hand: Hand, lean: float, heading: float) -> float:
    """The angle of the hand, were it not leaning."""
    if not lean:
        return hand.angle
    level = hand.turn.as_matrix()[:, 0]  # across the heading the finger axis keeps its direction
    return 0.0 if level[0] > 0 else math.pi


def _reach(view: View, grasp: Grasp) -> Route:
    """Up, over the target, down to it, and close the fingers."""
    hand, goal = view.hand, grasp.position
    close = _at(grasp, goal, CLOSED, math.inf, CLOSING_STEPS)
    down = _at(grasp, goal, OPEN, 0.003)
    if np.allclose(hand.position, goal, rtol=0, atol=0.005) and hand.opening > _SHUT_M:
        return (close,)
    if hand.opening > _OPEN_M and _before(hand, grasp):
        return (down, close)
    everything = (view.others, view.receptacle, view.target)
    height = max(boxes.height_along(hand.position, goal, BERTH_M) for boxes in everything)
    height = max(height + CLEARANCE_M + FINGERTIP_M, goal[2] + 0.05)
    if np.linalg.norm((hand.position - goal)[:2]) < _NEARBY_M:
        height = min(height, max(hand.position[2], view.target.high + FINGERTIP_M + 0.01))
    if grasp.lean:
        run_up = goal - 0.09 * grasp.axis
        above = Grasp(run_up, grasp.angle, grasp.lean, grasp.heading)
        return (*travel(hand, above, height, OPEN), _at(grasp, run_up, OPEN), down, close)
    return (*travel(hand, grasp, height, OPEN), down, close)


def _before(hand: Hand, grasp: Grasp) -> bool:
    """Whether the hand is in a funnel that leads to the grasp: the further off it is, the wider."""
    off = hand.position - grasp.position
    height = -float(off @ grasp.axis)
    aside = float(np.linalg.norm(off + height * grasp.axis))
    askew = abs(math.remainder(hand.angle - grasp.angle, math.pi)) + abs(hand.lean - grasp.lean)
    return (
        -0.01 < height < 0.12 + (0.0 if grasp.lean else 1.0)
        and askew < 0.15
        and aside < min(0.006 + 0.2 * height, 0.02)
    )


def _bring(view: View, grasp: Grasp) -> Route:
    """Up, over the goal, down, open the fingers and leave; the target moves along with the hand."""
    hand, start, end = view.hand, grasp.position, destination(view, grasp)
    hanging = start[2] - view.target.low
    down = _at(end, end.position, CLOSED, 0.008)
    release = _at(end, end.position, OPEN, math.inf, OPENING_STEPS)
    leave = _at(end, end.position - 0.1 * end.axis, OPEN)
    way = float(np.linalg.norm((end.position - start)[:2]))
    if view.frontal is not None and grasp.lean:
        return (*_enter(view, grasp, end), down, release, leave)
    if view.held and way < _DRIFT_M and abs(view.turn) < 0.1 and start[2] > end.position[2] - 0.01:
        if start[2] < end.position[2] + _STUCK_M and _stuck(hand):
            here = _at(grasp, start, OPEN, math.inf, OPENING_STEPS)
            return (here, _at(grasp, start - 0.1 * grasp.axis, OPEN))
        return (down, release, leave)
    height = max(boxes.height_along(start, end.position, BERTH_M) for boxes in (view.others, view.receptacle))
    height = max(height + CLEARANCE_M + max(hanging, FINGERTIP_M), start[2] + (0.0 if view.held else _LIFT_M))
    return (*travel(grasp, end, height, CLOSED), down, release, leave)


def _stuck(hand: Hand) -> bool:
    """Whether something holds it up; pressing, it may still slide a little."""
    return bool(abs(hand.velocity[2]) < 0.005 and np.linalg.norm(hand.velocity) < 0.04)


def _enter(view: View, grasp: Grasp, end: Grasp) -> Route:
    """In front of the opening, and level into it."""
    into = np.array([math.cos(end.heading), math.sin(end.heading), 0.0])
    level = end.position + np.array([0.0, 0.0, 0.012])
    off = grasp.position - level
    ahead = float(off @ into)
    if view.held and ahead > -_RUN_UP_M and np.linalg.norm(off - ahead * into) < 0.02:
        return (_at(end, level, CLOSED),)
    before = level - _RUN_UP_M * into
    up = np.array([*grasp.position[:2], max(grasp.position[2], before[2])])
    in_there = (_at(end, before, CLOSED, 0.01), _at(end, level, CLOSED))
    way = before - grasp.position
    over = view.others.height_along(view.position, view.position + way, _WIDTH_M)
    over += CLEARANCE_M + grasp.position[2] - view.target.low
    if over < before[2] or np.linalg.norm(way[:2]) < _NEARBY_M:
        return (_at(grasp, up, CLOSED, 0.015), *in_there)
    up[2] = max(up[2], over)
    return (_at(grasp, up, CLOSED, 0.015), _at(end, np.array([*before[:2], over]), CLOSED, 0.01), *in_there)


def _at(grasp: Grasp, position: Array, grip: float, tolerance_m: float = 0.005, wait: int = 0) -> Waypoint:
    """A waypoint with the orientation of a grasp."""
    return Waypoint(position, grasp.angle, grip, tolerance_m, wait, grasp.lean, grasp.heading)


def travel(start: Hand | Grasp, end: Grasp, height: float, grip: float) -> Route:
    """Up to a height, unless already there, and on that height to above the end."""
    # Half a turn has no direction of its own: it has to go through the middle of the wrist's range.
    angle = end.angle if abs(end.angle - start.angle) < _HALF_TURN_RAD else FACING
    over = _at(replace(end, angle=angle), np.array([*end.position[:2], height]), grip, 0.01)
    if start.position[2] > height - 0.02:
        return (over,)
    up = np.array([*start.position[:2], height])
    if isinstance(start, Grasp):
        return (_at(start, up, grip, 0.02), over)
    return (Waypoint(up, start.angle if start.lean < 0.2 else end.angle, grip, 0.02), over)
