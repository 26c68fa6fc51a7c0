"""A policy that knows where everything is: it solves the tasks, and finds its way again after an event.

It has no memory. At every query it looks at the simulator, works out the whole route from the present
situation to the end of what is to be done next, and returns the first actions of it. A target that slipped
out of the fingers, or a receptacle that moved, is then nothing special: the next route starts from there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.articulation import make_room, operate
from pytest_libero_max.experts.motion import OPEN, Route, Waypoint, follow
from pytest_libero_max.experts.pick_and_place import place
from pytest_libero_max.experts.regrasp import prepare
from pytest_libero_max.experts.retreat import disengage
from pytest_libero_max.experts.scene_view import (
    AJAR_M,
    Hand,
    drawer_of,
    holds_target,
    look,
    look_at_hand,
    look_at_parts,
    owner_of,
)
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.embedded.tasks import Fact

Array = NDArray[np.float64]


class ExpertPolicy:
    """Plans anew at every query. It asks for the images a learned policy would get, and ignores them."""

    spec = PolicySpec("expert", horizon=10, query_interval=5, privileged=True)

    def reset(self, episode: Episode) -> None:
        self._world: Any = episode.world

    def predict(self, observation: Observation, query: Query) -> Array:
        hand = look_at_hand(self._world)
        actions, _ = follow(hand, plan(self._world, hand), self.spec.horizon)
        return actions


def plan(world: Any, hand: Hand) -> Route:
    """The way from here to the end of what has to be done next."""
    todo = stages(world)
    if not todo:
        return (Waypoint(hand.position + np.array([0.0, 0.0, 0.05]), hand.angle, OPEN),)
    if holds_target(world, todo[0]):
        return carry_out(world, todo[0], hand)
    return disengage(world, todo[0], hand) or carry_out(world, todo[0], hand)


def stages(world: Any) -> list[Fact]:
    """What is to be done, in order: finish what is in the hand, make room, bring, and close at last."""
    todo = [fact for fact in world.goal if holds_target(world, fact)]
    missing = [fact for fact in world.goal if fact not in todo and not world.holds(fact)]
    todo += sorted(missing, key=lambda fact: _ORDER[fact.predicate])
    for fact in todo:
        if fact.predicate == "in" and drawer_of(world, fact.place) is not None:
            return [*_opening(world, fact), *todo]
    return todo


def _opening(world: Any, fact: Fact) -> list[Fact]:
    """What has to be done before something can be put into a drawer: put it aside, and draw."""
    place = str(fact.place)
    joint = drawer_of(world, place)
    drawn = float(world.data.joint(joint).qpos[0])
    if drawn <= AJAR_M:
        return []
    handle = next(part for part in look_at_parts(world) if part.joint == joint)
    off = world.position(fact.subject) - (handle.position - drawn * handle.motion)
    aside = float(np.linalg.norm(off[:2] - (off[:2] @ handle.out[:2]) * handle.out[:2]))
    in_the_way = off[2] < 0.0 and off @ handle.out < _BEFORE_M and aside < _BESIDE_M
    drawer = Fact("open", place)
    if in_the_way or holds_target(world, fact):
        return [Fact("on", fact.subject, f"{owner_of(world, place)}_top_side"), drawer]
    return [drawer]


def carry_out(world: Any, fact: Fact, hand: Hand) -> Route:
    """The way from here to the end of one stage."""
    if fact.place is None:
        return operate(world, fact, hand)
    view = prepare(look(world, fact, hand))
    room = () if view.held else make_room(world, owner_of(world, fact.place), hand)
    return (*room, *place(view))


_BEFORE_M, _BESIDE_M = 0.25, 0.2  # of the handle of a closed drawer: what stands there ends up under it
_ORDER = {"turnoff": 0, "turnon": 0, "open": 1, "in": 2, "on": 2, "close": 3}

policy = ExpertPolicy
