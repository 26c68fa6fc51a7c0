"""A policy that reads the simulator: it solves the tasks and recovers after an event.

It has no memory. At every query it reads the state of the world, plans the whole route to the end of the next
subgoal, and returns the first actions of it. An object that slipped out of the fingers, or a receptacle that
moved, needs no special treatment: the next route starts from the situation as it is.
"""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.articulation import articulate, open_door
from pytest_libero_max.experts.motion import OPEN, Route, Waypoint, follow
from pytest_libero_max.experts.pick_and_place import pick_and_place, with_regrasp
from pytest_libero_max.experts.scene_view import (
    DRAWER_NEARLY_OPEN_M,
    Hand,
    drawer_joint,
    is_holding_subject,
    obstacles,
    owner_of,
    privileged_world,
    read_hand,
    read_part,
    read_parts,
    view_scene,
)
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.privileged import ExpertWorld, Fact

Array = NDArray[np.float64]

_BEFORE_M, _BESIDE_M = 0.25, 0.2  # of the handle of a closed drawer: what stands there ends up under it
_ORDER = MappingProxyType({"turnoff": 0, "turnon": 0, "open": 1, "in": 2, "on": 2, "close": 3})
_TILTED_RAD = 0.3
_NEAR_M = 0.03
_BACK_M = 0.1
_OPENING_STEPS = 6
_BETWEEN_FINGERS_M = (0.045, 0.03, 0.03)  # half sizes of the space between open fingers, in the hand's frame


class ExpertPolicy:
    """Plans anew at every query. It asks for the images that a learned policy would get, and ignores them."""

    spec = PolicySpec("expert", horizon=10, query_interval=5, privileged=True)

    def reset(self, episode: Episode) -> None:
        """Keep the world to read."""
        self._world = privileged_world(episode, self.spec)

    def predict(self, observation: Observation, query: Query) -> Array:
        hand = read_hand(self._world)
        actions, _ = follow(hand, plan(self._world, hand), self.spec.horizon)
        return actions


def plan(world: ExpertWorld, hand: Hand) -> Route:
    """Return the route to the end of the next subgoal; up and away where nothing is left to do."""
    left = subgoals(world)
    if not left:
        return (Waypoint(hand.position + np.array([0.0, 0.0, 0.05]), hand.angle, OPEN),)
    if is_holding_subject(world, left[0]):
        return plan_subgoal(world, left[0], hand)
    return retreat(world, left[0], hand) or plan_subgoal(world, left[0], hand)


def subgoals(world: ExpertWorld) -> list[Fact]:
    """Subgoals that are left, in order.

    First the object in the hand, then knobs, drawers and doors to open, then objects to bring, and at last
    drawers and doors to close. A closed drawer into which something goes is opened first.
    """
    left = [fact for fact in world.goal if is_holding_subject(world, fact)]
    missing = [fact for fact in world.goal if fact not in left and not world.holds(fact)]
    left += sorted(missing, key=lambda fact: _ORDER[fact.predicate])
    for fact in left:
        if fact.predicate == "in" and drawer_joint(world, str(fact.place)) is not None:
            return [*_before_the_drawer(world, fact), *left]
    return left


def _before_the_drawer(world: ExpertWorld, fact: Fact) -> list[Fact]:
    """Subgoals before an object can go into a drawer.

    Nothing, if the drawer is open. Otherwise it is opened; before that, an object that is in the hand or in
    the way of the drawer is put onto the cabinet.
    """
    place = str(fact.place)
    joint = drawer_joint(world, place)
    drawn = float(world.data.joint(joint).qpos[0])
    if drawn <= DRAWER_NEARLY_OPEN_M:
        return []
    handle = read_part(world, joint)
    off = world.position(fact.subject) - (handle.position - drawn * handle.motion)
    aside = float(np.linalg.norm(off[:2] - (off[:2] @ handle.out[:2]) * handle.out[:2]))
    in_the_way = off[2] < 0.0 and off @ handle.out < _BEFORE_M and aside < _BESIDE_M
    drawer = Fact("open", place)
    if in_the_way or is_holding_subject(world, fact):
        return [Fact("on", fact.subject, f"{owner_of(world, place)}_top_side"), drawer]
    return [drawer]


def plan_subgoal(world: ExpertWorld, fact: Fact, hand: Hand) -> Route:
    """Return the route to the end of one subgoal."""
    if fact.place is None:
        return articulate(world, fact, hand)
    view = with_regrasp(view_scene(world, fact, hand))
    door = () if view.held else open_door(world, owner_of(world, fact.place), hand)
    return (*door, *pick_and_place(view))


def retreat(world: ExpertWorld, fact: Fact, hand: Hand) -> Route:
    """Open the fingers and draw back along them, if the hand is tilted and still at a part or an obstacle.

    A hand that points straight down needs no retreat: every route begins upwards. Entities that belong to the
    next subgoal are no obstacles.
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


VERSION = 1
"""See :func:`.references.shipped_version`."""

policy = ExpertPolicy
