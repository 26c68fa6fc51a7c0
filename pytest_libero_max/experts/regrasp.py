"""Regrasping: putting a mug down in front of a door first, so that its handle can be reached.

An object that enters a receptacle from the front is held by its handle, with a tilted hand that can push it
in. Where the handle cannot be reached, the object is taken by its rim, turned and put down once before.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.grasp import TILT, Grasp, crowding
from pytest_libero_max.experts.scene_view import WRIST_MIDDLE_RAD, Boxes, Part, View

Array = NDArray[np.float64]

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
