"""Faults that were written before the rules that they changed; see :mod:`.judge`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pytest_libero_max.policies.contract import Query
from tests.report.faults.faulty import Array, Fault, Faulty, grip

SPATIAL = tuple(("libero_spatial", task) for task in (0, 2, 5, 7))
OBJECT = tuple(("libero_object", task) for task in (1, 4, 6, 8))
PICKS = (SPATIAL[0], OBJECT[1], SPATIAL[2], OBJECT[2], ("libero_goal", 8), OBJECT[0])
TWO = (("libero_10", 0), ("libero_10", 1), ("libero_10", 4), ("libero_10", 6))
DRAWER = (("libero_goal", 3), ("libero_10", 3))
PULLS = (("libero_goal", 0), ("libero_goal", 7), ("libero_10", 2))

TARGET, GOAL = ("target_relocation",), ("receptacle_relocation",)
LIGHT = ("illumination_switch", "visual_theme_switch", "camera_shift")


def _waits_above(policy: Faulty, query: Query) -> Array:
    """Wait 2 to 5 cm above the grasp with open fingers."""
    return grip(policy.expert([0.0, 0.0, -policy.draw("height", 0.02, 0.05)]), -1.0)


def _waits_there(policy: Faulty, query: Query) -> Array:
    """Wait around the object, at the grasp, and do not move any more."""
    if np.linalg.norm(policy.hand - policy.at(policy.target)) < 0.09:
        policy.memory["arrived"] = True
    return policy.still() if policy.memory.get("arrived") else grip(policy.expert(), -1.0)


def _fist(policy: Faulty, query: Query) -> Array:
    """Close the hand at once, far from the object, and go on with closed fingers."""
    return grip(policy.expert(), 1.0)


def _old_goal(policy: Faulty, query: Query) -> Array:
    """Bring the object to where the destination was."""
    old = policy.memory.get("old", {})
    name = next(iter(old), None)
    if name is None or not policy.held():
        return policy.expert()
    return policy.expert_to(old[name] - policy.at(name))


def _another_goal(policy: Faulty, query: Query) -> Array:
    """Bring the object to a place 17 to 25 cm away from the destination, and from where that was."""
    policy.truth("timed_out_holding" if policy.held() else "placed_elsewhere")
    if not policy.held():
        return policy.expert()
    off = policy.aside("off", 0.17, 0.25)
    for turn in range(8):
        angle = turn * np.pi / 4
        c, s = np.cos(angle), np.sin(angle)
        tried = np.array([c * off[0] - s * off[1], s * off[0] + c * off[1], 0.0])
        spot = policy.place() + tried
        olds = list(policy.memory.get("old", {}).values())
        if all(np.linalg.norm((spot - old)[:2]) > 0.17 for old in olds) and abs(spot[1]) < 0.3:
            break
    return policy.expert_to(tried)


def _holds(policy: Faulty, query: Query) -> Array:
    """Lift the object and stay where that is."""
    if policy.lifted_m() > 0.04:
        policy.memory["up"] = True
    return policy.still(1.0) if policy.memory.get("up") else policy.expert()


def _closes_nowhere(policy: Faulty, query: Query) -> Array:
    """Close 8 to 12 cm beside the object, away from where it was as well."""
    old = next(iter(policy.memory.get("old", {}).values()), None)
    way = np.zeros(3) if old is None else old - policy.at(policy.target)
    aside = np.array([-way[1], way[0], 0.0]) / (np.linalg.norm(way) or 1.0)
    if old is None:
        aside = policy.aside("direction", 1.0, 1.0)
    return policy.expert(aside * policy.draw("off", 0.08, 0.12))


def _starts_late(policy: Faulty, query: Query) -> Array:
    """Wait, so that the hand gets to the object just before the time is up."""
    late = policy.max_steps - policy.draw("needs", 25, 45)
    return policy.still() if query.step < late else policy.expert()


def _rises_after_the_first(policy: Faulty, query: Query) -> Array:
    """Do the first of two things, then go up and stay there."""
    if len(policy.left) < len(policy.world.goal):
        policy.memory["done"] = True
    if not policy.memory.get("done"):
        return policy.expert()
    actions = policy.still()
    actions[:, 2] = 0.4
    return actions


def _pulls_beside(policy: Faulty, query: Query) -> Array:
    """Pull beside the handle of the drawer; park what is in its way as the expert does."""
    facts = policy.left
    if facts and facts[0].predicate == "open":
        return policy.expert([0.0, policy.draw("off", 0.05, 0.08), 0.0])
    return policy.expert()


def _freezes(policy: Faulty, query: Query) -> Array:
    """Stop at once."""
    return policy.still()


def _freezes_later(policy: Faulty, query: Query) -> Array:
    """Go away from the object for a while, and stop there."""
    after = policy.since("broken", query)
    if after >= 40:
        return policy.still()
    return policy.towards(policy.hand + policy.aside("away", 0.05, 0.05) + np.array([0.0, 0.0, 0.03]))


def _drops(policy: Faulty, query: Query) -> Array:
    """Open the hand some steps after the lift."""
    if policy.memory.get("open") or (
        policy.lifted_m() > 0.03 and policy.since("up", query) >= policy.draw("steps", 10, 30)
    ):
        if not policy.memory.get("open"):
            high, near = policy.lifted_m(), policy.goal_m()
            if near < 0.04 or 0.03 < high < 0.07:
                policy.truth("dropped", "placed_elsewhere", "placed_beside_goal")
            else:
                policy.truth("dropped" if high > 0.05 else "placed_elsewhere")
        policy.memory["open"] = True
        return policy.still()
    return policy.expert()


def _beside(policy: Faulty, query: Query) -> Array:
    """Take the hand to be 5 to 8 cm beside where it is."""
    if np.linalg.norm(policy.at(policy.target) - policy.memory["start"][policy.target]) > 0.04:
        policy.truth("grasp_missed", "pushed_target", "toppled_target")
    return policy.expert(policy.aside("beside", 0.05, 0.08))


def _slow(policy: Faulty, query: Query) -> Array:
    """Move at a tenth of the speed."""
    actions = policy.expert()
    actions[:, :3] *= policy.draw("speed", 0.05, 0.09)
    return actions


def _oscillates(policy: Faulty, query: Query) -> Array:
    """Swing left and right above where the hand is."""
    home = policy.memory.setdefault("home", policy.hand + np.array([0.0, 0.0, 0.08]))
    side = 0.08 if (query.step // 10) % 2 else -0.08
    return policy.towards(home + np.array([0.0, side, 0.0]))


def _takes_another(policy: Faulty, query: Query) -> Array:
    """Take another object to the destination."""
    world = policy.world
    subjects = {fact.subject for fact in world.goal} | {fact.place for fact in world.goal}
    others = sorted(name for name in policy._objects() if name not in subjects and "plate" not in name)
    others = [name for name in others if "basket" not in name]
    if not others:
        return policy.expert()
    near = min(
        others,
        key=lambda name: float(
            np.linalg.norm(
                policy.memory["start"].get(name, policy.at(name)) - policy.memory["start"][policy.target]
            )
        ),
    )
    goal = tuple(replace(fact, subject=near) for fact in world.goal[:1])
    return policy.expert(goal=goal)


def _mirrored_goal(policy: Faulty, query: Query) -> Array:
    """Bring the object to the mirror image of the destination."""
    if not policy.held():
        return policy.expert()
    goal = policy.place()
    mirror = goal * [1.0, -1.0, 1.0]
    near = abs(2 * goal[1]) < 0.17
    policy.truth(
        "placed_beside_goal" if near else "placed_elsewhere",
        "timed_out_holding",
        "blocked_by_obstacle",
        "dropped",
    )
    return policy.expert_to(mirror - goal)


def _repeats_the_first(policy: Faulty, query: Query) -> Array:
    """Do the first of two things, take it out again, and put it beside."""
    first = policy.memory.setdefault("first", policy.left[0])
    if policy.world.holds(first):
        policy.memory["again"] = True
    if not policy.memory.get("again"):
        return policy.expert()
    if policy.held(first.subject):
        if policy.at(first.subject)[2] > policy.memory["start"][first.subject][2] + 0.12:
            policy.memory["up"] = True
        spot = policy.place() + np.array([0.0, -0.22 if policy.place()[1] > 0 else 0.22, 0.2])
        if policy.memory.get("up"):
            return policy.towards(spot, 1.0)
        return policy.towards(policy.hand + np.array([0.0, 0.0, 0.2]), 1.0)
    return policy.expert(goal=(first,), holds=lambda fact: False)


def _presses_on_the_table(policy: Faulty, query: Query) -> Array:
    """Press the open hand on the table 16 to 20 cm from the object."""
    spot = policy.memory.setdefault("spot", policy.at(policy.target) + policy.aside("off", 0.16, 0.2))
    return policy.towards([spot[0], spot[1], spot[2] - 0.2])


def _runs_into_the_obstacle(policy: Faulty, query: Query) -> Array:
    """Push against what was put there."""
    new = sorted(set(policy._objects()) - set(policy.memory["start"]))
    if not new:
        return policy.expert()
    return policy.towards(policy.at(new[0]) + np.array([0.0, 0.0, -0.03]))


def _closes_on_the_way(policy: Faulty, query: Query) -> Array:
    """Close the hand 12 cm above the object, and go down with closed fingers."""
    if policy.hand[2] - policy.at(policy.target)[2] < 0.12:
        policy.memory["shut"] = True
    return grip(policy.expert(), 1.0 if policy.memory.get("shut") else -1.0)


def _grasps_too_high(policy: Faulty, query: Query) -> Array:
    """Close 4 to 6 cm above the grasp."""
    return policy.expert([0.0, 0.0, -policy.draw("high", 0.04, 0.06)])


def _of(*causes: str) -> frozenset[str]:
    return frozenset(causes)


FAULTS = (
    Fault("waits_above", _waits_above, _of("never_closed"), PICKS),
    Fault("waits_there", _waits_there, _of("never_closed"), PICKS),
    Fault("fist", _fist, _of("closed_early"), PICKS),
    Fault("old_goal", _old_goal, _of("missed_moved_goal"), SPATIAL + OBJECT, GOAL),
    Fault(
        "another_goal",
        _another_goal,
        _of("placed_elsewhere", "timed_out_holding", "dropped"),
        SPATIAL + OBJECT,
        GOAL + LIGHT[:1],
    ),
    Fault("holds", _holds, _of("timed_out_holding"), SPATIAL + OBJECT, GOAL + LIGHT[:1]),
    Fault(
        "closes_nowhere", _closes_nowhere, _of("grasp_missed", "never_reached"), OBJECT + SPATIAL[:1], TARGET
    ),
    Fault("starts_late", _starts_late, _of("timed_out", "timed_out_holding"), PICKS, LIGHT),
    Fault(
        "rises_after_the_first",
        _rises_after_the_first,
        _of("never_reached", "froze", "not_attempted"),
        TWO,
        LIGHT,
    ),
    Fault(
        "pulls_beside_the_handle",
        _pulls_beside,
        _of("part_not_moved", "part_moved_too_little", "blocked_by_obstacle"),
        DRAWER[:1] + PULLS,
        LIGHT,
    ),
    Fault("freezes", _freezes, _of("froze_after_event"), PICKS, LIGHT),
    Fault("freezes_later", _freezes_later, _of("froze", "never_reached"), PICKS, LIGHT),
    Fault("drops", _drops, _of("dropped"), PICKS, LIGHT),
    Fault("grasps_beside", _beside, _of("grasp_missed"), PICKS, LIGHT),
    Fault("slow", _slow, _of("timed_out", "timed_out_holding"), PICKS, LIGHT),
    Fault("oscillates", _oscillates, _of("never_reached"), PICKS, LIGHT),
    Fault("takes_another", _takes_another, _of("wrong_object"), SPATIAL + OBJECT, LIGHT),
    Fault("mirrored_goal", _mirrored_goal, _of("placed_elsewhere"), SPATIAL, LIGHT),
    Fault(
        "repeats_the_first", _repeats_the_first, _of("undone", "never_reached", "moved_goal"), TWO[:2], LIGHT
    ),
    Fault(
        "presses_on_the_table",
        _presses_on_the_table,
        _of("never_reached", "stuck", "pushed_target", "toppled_target", "blocked_by_obstacle"),
        PICKS,
        LIGHT,
    ),
    Fault(
        "runs_into_the_obstacle",
        _runs_into_the_obstacle,
        _of("blocked_by_obstacle", "hit_obstacle"),
        PICKS,
        ("obstacle_insertion",),
    ),
    Fault(
        "closes_on_the_way",
        _closes_on_the_way,
        _of("closed_early", "grasp_missed", "timed_out_holding"),
        PICKS,
        LIGHT,
    ),
    Fault("grasps_too_high", _grasps_too_high, _of("grasp_missed", "grasp_slipped"), PICKS, LIGHT),
)
