"""Faults that were written after the rules, to measure them; see :mod:`.judge`."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.policies.contract import Query
from tests.report.faults.faulty import Array, Fault, Faulty, grip
from tests.report.faults.first import GOAL, LIGHT, OBJECT, PICKS, SPATIAL, TARGET, TWO

UP = np.array([0.0, 0.0, 1.0])


def _goes_home(policy: Faulty, query: Query) -> Array:
    """Go back to about where the hand began, and stay."""
    home = policy.memory.setdefault("home", policy.hand + np.array([-0.1, 0.0, 0.2]))
    return policy.towards(home) if policy.since("broken", query) < 60 else policy.still()


def _opens_at_once(policy: Faulty, query: Query) -> Array:
    """Open the hand as soon as the object is off its support, and stay."""
    if policy.lifted_m() > 0.012:
        policy.memory["open"] = True
    return policy.still() if policy.memory.get("open") else policy.expert()


def _flies_off(policy: Faulty, query: Query) -> Array:
    """Go away from the object, to one side and up, without end."""
    return policy.towards(policy.hand + policy.aside("side", 0.02, 0.05) + 0.02 * UP)


def _never_opens(policy: Faulty, query: Query) -> Array:
    """Keep the hand closed over the destination."""
    if policy.lifted_m() > 0.02:
        policy.memory["shut"] = True
    return grip(policy.expert(), 1.0) if policy.memory.get("shut") else policy.expert()


def _opens_high_over_the_goal(policy: Faulty, query: Query) -> Array:
    """Open the hand 12 cm or more above the plate."""
    if policy.held() and policy.goal_m() < 0.05 and policy.lifted_m() > 0.05:
        policy.memory["open"] = True
    if policy.memory.get("open"):
        return policy.still()
    actions = policy.expert()
    if policy.held() and policy.lifted_m() < 0.2:
        actions[:, :3] = np.clip(20 * np.array([0.0, 0.0, 0.22 - policy.lifted_m()]), -1, 1)
    return actions


def _stops_short(policy: Faulty, query: Query) -> Array:
    """Put the object down 9 to 12 cm from the middle of the plate."""
    return policy.expert_to(policy.aside("off", 0.09, 0.12)) if policy.held() else policy.expert()


def _puts_it_back(policy: Faulty, query: Query) -> Array:
    """Lift the object and put it down where it was."""
    if policy.lifted_m() > 0.1:
        policy.memory["back"] = True
    if not policy.memory.get("back"):
        actions = policy.expert()
        if policy.held():
            actions[:, :3] = [0.0, 0.0, 0.6]
        return actions
    if policy.memory.get("down") or not policy.held():
        policy.memory["down"] = True
        return policy.towards(policy.hand + 0.05 * UP) if policy.since("down", query) < 20 else policy.still()
    start = policy.memory["start"][policy.target]
    low = policy.at(policy.target)[2] - start[2] < 0.012
    spot = policy.hand + (start - policy.at(policy.target))
    return policy.towards(spot, -1.0 if low else 1.0, 0.4)


def _skips_the_first(policy: Faulty, query: Query) -> Array:
    """Do the second of two things alone."""
    goal = tuple(policy.world.goal)
    first = policy.memory.setdefault("first", policy.left[0])
    return policy.expert(goal=tuple(fact for fact in goal if fact != first))


def _freezes_around_it(policy: Faulty, query: Query) -> Array:
    """Stop with closed fingers around the object, before it is lifted."""
    if policy.held():
        policy.memory["has"] = True
    return policy.still(1.0) if policy.memory.get("has") else policy.expert()


def _freezes_over_the_goal(policy: Faulty, query: Query) -> Array:
    """Stop with the object over the destination, and hold it."""
    if policy.held() and policy.goal_m() < 0.05:
        policy.memory["there"] = True
    return policy.still(1.0) if policy.memory.get("there") else policy.expert()


def _slow_after_the_lift(policy: Faulty, query: Query) -> Array:
    """Move at a thirtieth of the speed once the object is up."""
    actions = policy.expert()
    if policy.lifted_m() > 0.03:
        policy.memory["up"] = True
    if policy.memory.get("up"):
        actions[:, :3] *= 0.03
    return actions


def _slow_approach(policy: Faulty, query: Query) -> Array:
    """Move at 2 to 3 % of the speed."""
    actions = policy.expert()
    actions[:, :3] *= policy.draw("speed", 0.02, 0.03)
    return actions


def _swings_over_it(policy: Faulty, query: Query) -> Array:
    """Swing over the object with open fingers."""
    side = 0.04 if (query.step // 10) % 2 else -0.04
    spot = policy.memory["start"][policy.target] + [0.0, side, 0.09]
    return policy.towards(spot)


def _old_place(policy: Faulty, query: Query) -> Array:
    """Close where the object was."""
    old = policy.memory.get("old", {}).get(policy.target)
    first = policy.memory.setdefault("new", policy.at(policy.target))
    return policy.expert() if old is None else policy.expert(first - old)


def _far_beside(policy: Faulty, query: Query) -> Array:
    """Close 20 to 25 cm beside the object."""
    return policy.expert(policy.aside("beside", 0.2, 0.25))


def _leaves_too_late(policy: Faulty, query: Query) -> Array:
    """Rise and wait, and go to the object when 10 to 20 steps are left."""
    if query.step < policy.max_steps - policy.draw("left", 10, 20):
        rising = policy.since("broken", query) < 20
        return policy.towards(policy.hand + 0.02 * UP) if rising else policy.still()
    return policy.expert()


def _half_open(policy: Faulty, query: Query) -> Array:
    """Stop when the drawer is open by 3 to 6 cm."""
    facts = [fact for fact in policy.world.goal if fact.predicate == "open"]
    joint = policy.world.joints(facts[0].subject)[0]
    if abs(float(policy.world.data.joint(joint).qpos[0])) > policy.draw("way", 0.03, 0.06):
        policy.memory["enough"] = True
    return policy.still(1.0) if policy.memory.get("enough") else policy.expert()


def _rams_the_goal(policy: Faulty, query: Query) -> Array:
    """Carry the object low and straight, into the side of the basket and on."""
    if policy.held() and policy.lifted_m() > 0.03:
        policy.memory["up"] = True
    if not policy.memory.get("up"):
        return policy.expert()
    way = policy.memory.setdefault("way", policy.place() - policy.hand)
    way = np.array([way[0], way[1], 0.0]) / np.linalg.norm(way[:2])
    return policy.towards(policy.hand + 0.08 * way, 1.0)


def _waits_at_the_old_place(policy: Faulty, query: Query) -> Array:
    """Wait above where the object was, with open fingers."""
    old = policy.memory.get("old", {}).get(policy.target)
    return policy.expert() if old is None else policy.towards(old + 0.06 * UP)


def _drops_late(policy: Faulty, query: Query) -> Array:
    """Open the hand at travel height, half-way to the destination, and stay."""
    far = policy.memory.setdefault("far", policy.goal_m())
    if policy.lifted_m() > 0.07 and policy.goal_m() < 0.55 * far:
        policy.memory["open"] = True
        near, high = policy.goal_m(), policy.lifted_m()
        policy.memory.setdefault("dropped at", (near, high))
    return policy.still() if policy.memory.get("open") else policy.expert()


def _of(*causes: str) -> frozenset[str]:
    return frozenset(causes)


FAULTS = (
    Fault("goes_home", _goes_home, _of("never_reached", "froze"), PICKS, LIGHT),
    Fault("opens_at_once", _opens_at_once, _of("dropped"), PICKS, LIGHT),
    Fault("flies_off", _flies_off, _of("never_reached", "froze"), PICKS, LIGHT),
    Fault("never_opens", _never_opens, _of("timed_out_holding"), OBJECT, LIGHT),
    Fault(
        "opens_high_over_the_goal",
        _opens_high_over_the_goal,
        _of("dropped", "placed_beside_goal"),
        SPATIAL,
        LIGHT,
    ),
    Fault("stops_short", _stops_short, _of("placed_beside_goal"), SPATIAL, LIGHT),
    Fault("puts_it_back", _puts_it_back, _of("placed_elsewhere"), PICKS, LIGHT),
    Fault("skips_the_first", _skips_the_first, _of("never_reached", "froze"), TWO, LIGHT),
    Fault("freezes_around_it", _freezes_around_it, _of("froze"), PICKS, LIGHT),
    Fault("freezes_over_the_goal", _freezes_over_the_goal, _of("timed_out_holding"), OBJECT, LIGHT),
    Fault("slow_after_the_lift", _slow_after_the_lift, _of("timed_out_holding"), PICKS, LIGHT),
    Fault("slow_approach", _slow_approach, _of("timed_out"), PICKS, LIGHT),
    Fault("swings_over_it", _swings_over_it, _of("never_closed"), PICKS, LIGHT),
    Fault("old_place", _old_place, _of("missed_moved_target"), OBJECT + SPATIAL[:1], TARGET),
    Fault("far_beside", _far_beside, _of("never_reached", "blocked_by_obstacle"), PICKS, LIGHT),
    Fault("leaves_too_late", _leaves_too_late, _of("timed_out"), PICKS, LIGHT),
    Fault("half_open", _half_open, _of("part_moved_too_little"), (("libero_goal", 0),), LIGHT),
    Fault("rams_the_goal", _rams_the_goal, _of("moved_goal", "timed_out_holding"), OBJECT, LIGHT),
    Fault("waits_at_the_old_place", _waits_at_the_old_place, _of("never_reached", "froze"), OBJECT, TARGET),
    Fault("drops_late", _drops_late, _of("dropped"), PICKS, LIGHT + GOAL),
)
