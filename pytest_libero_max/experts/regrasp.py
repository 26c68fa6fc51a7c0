"""Putting something down before a door first, so that its handle is free and the hand can push it in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.grasp import LEAN, Grasp, crowd
from pytest_libero_max.experts.scene_view import FACING, Boxes, Part, View

Array = NDArray[np.float64]

# Where it can be put down, from where it has to be in the end: so far before the door, so far to the right.
_SPOTS_M = tuple((before, aside) for before in (0.344, 0.4, 0.46) for aside in (0.0, 0.05, -0.05, 0.1, -0.1))
_FREE_M = 0.07  # from its middle to anything else
_REACH_M = (0.55, 0.72)
_SPARE_M = 0.015  # of that, so that it is still within reach where it really stands
_TIGHT = 3.0  # a more crowded handle cannot be reached
_ASKEW_RAD = 0.35
_NOTHING = Boxes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
_BY_HANDLE_RAD = 0.3  # a hand that leans further holds it by its handle


def prepare(view: View) -> View:
    """The view for what has to be done next with something that goes in at the front.

    If its handle cannot be reached, it is taken by its rim and put down where that can be.
    """
    handle = _handle(view)
    if view.frontal is None or handle is None or (view.held and view.hand.lean > _BY_HANDLE_RAD):
        return view
    outwards = math.remainder(view.frontal + math.pi, 2 * math.pi)
    turn = math.remainder(outwards - math.atan2(handle.out[1], handle.out[0]), 2 * math.pi)
    if not view.held and abs(turn) < _ASKEW_RAD and _reachable(view, handle.position):
        return view
    if view.held and abs(view.hand.angle + turn - FACING) > math.pi:
        turn -= math.copysign(2 * math.pi, turn)  # the wrist turns the other way
    spot = _spot(view, view.frontal, handle)
    if spot is None:
        return view
    return replace(
        view,
        goal=spot,
        inside=False,
        frontal=None,
        turn=turn,
        receptacle=_NOTHING,
        others=_together(view.others, view.receptacle),
    )


def _spot(view: View, frontal: float, handle: Part) -> Array | None:
    """(3,) m: where its origin can come down with the handle outwards; None if there is no room."""
    into = np.array([math.cos(frontal), math.sin(frontal)])
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
    """Whether there is room for a hand that leans over to a handle, and the arm gets there."""
    assert view.frontal is not None
    grasp = Grasp(position, view.frontal + math.pi / 2, LEAN, view.frontal)
    far = float(np.linalg.norm((position - view.hand.base)[:2]))
    return _REACH_M[0] + spare_m < far < _REACH_M[1] - spare_m and crowd(view, grasp, taking=True) < _TIGHT


def _handle(view: View) -> Part | None:
    """The handle at its side, if it stands upright."""
    sideways = (part for part in view.parts if abs(part.out[2]) < 0.3 and abs(part.along[2]) > 0.9)
    return next(sideways, None)


def _together(one: Boxes, other: Boxes) -> Boxes:
    pairs = ((one.centre, other.centre), (one.turn, other.turn), (one.half, other.half))
    centre, turn, half = (np.concatenate(pair) for pair in pairs)
    return Boxes(centre, turn, half)
