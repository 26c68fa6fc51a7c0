"""Whether a case is physically sensible: asked of the simulator, before any policy plays it.

The hand is driven in a straight line towards a point above the trigger entity until it is within the
trigger distance, the event is applied there, and the world is held still for a second, once with and once
without the event.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import hypot

import numpy as np

from pytest_libero_max.cases import SETTLE_STEPS, Case
from pytest_libero_max.changes import Change, change_from_dict
from pytest_libero_max.errors import SimulatorError
from pytest_libero_max.worlds.contract import CONTROL_HZ, NOOP_ACTION, Array, World

MAX_SHIFT_M = 0.02
"""How much farther than without the event anything may drift while the world is held still."""

MAX_DROP_M = 0.01
"""How much farther than without the event anything may sink."""

MIN_CLEARANCE_M = 0.01
"""How far what an event moves or brings in must be from all but its support: room for a fingertip's edge."""

MAX_REACH_M = 0.80
"""Horizontal distance from the robot's base within which a moved target or receptacle must end: about
that of the farthest target in LIBERO's own tasks, with the tool pointing down."""

_APPROACH_STEPS = 100
_HOLD_STEPS = CONTROL_HZ
_ABOVE_M = (0.0, 0.0, 0.1)
_STEP_M = 0.05  # what the controller makes of a full translation action
_BASE_BODY = "robot0_base"


def problems(world: World, case: Case) -> tuple[str, ...]:
    """What speaks against a case; nothing if it passes.

    The conditions: the hand comes within the trigger distance; the event does not solve the
    task; what it moves or brings in keeps clear of everything, stays where it was put, keeps the contact with
    its support and reaches no new one; nothing else is pushed; a moved target or receptacle stays within
    reach; the simulation stays finite.

    Args:
        world: The world that plays the case. It is reset.
        case: The case.
    """
    try:
        return tuple(dict.fromkeys(_examine(world, case)))
    except SimulatorError as error:
        return (f"the simulation breaks: {error}",)


def _examine(world: World, case: Case) -> Iterable[str]:
    world.reset(case.init_state_index)
    change = change_from_dict(case.event.change)
    entities = sorted(factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:"))
    touching = {name: set(world.contacts(name)) for name in entities}
    for raw in case.event.setup:
        change_from_dict(raw).apply(world)
    _hold(world, SETTLE_STEPS)
    if not approach(world, case):
        trigger = case.event.trigger
        yield f"the hand does not come within {trigger.distance_m} m of {trigger.entity}"
        return
    if world.succeeded():
        yield "the task is solved before the event"
        return
    for name in entities:
        if name not in world.parked:
            touching[name] |= set(world.contacts(name))
    at_trigger = world.snapshot()
    calm = _drift(world)
    world.restore(at_trigger)
    change.apply(world)
    for name in entities:
        yield from _too_close(world, name, touching[name])
    yield from _out_of_reach(world, change)
    disturbed = _drift(world)
    if world.succeeded():
        yield "the event solves the task"
    for name, (shift, drop) in disturbed.items():
        calm_shift, calm_drop = calm.get(name, (0.0, 0.0))
        if shift - calm_shift > MAX_SHIFT_M or drop - calm_drop > MAX_DROP_M:
            yield f"{name} moves by {shift * 1000:.0f} mm, {drop * 1000:.0f} mm of it down, after the event"
    for name in entities:
        support = world.entities[name].support
        if support in touching[name] and support not in world.contacts(name):
            yield f"{name} has lost its support {support}"
    yield from _overlaps(world, entities, touching)


def _hold(world: World, steps: int) -> None:
    for _ in range(steps):
        world.step(NOOP_ACTION)


def approach(world: World, case: Case) -> bool:
    """Drive the hand in a straight line towards the trigger entity until the event would fire.

    Returns:
        Whether it came within the trigger distance.
    """
    trigger = case.event.trigger
    for _ in range(_APPROACH_STEPS):
        target, hand = world.position(trigger.entity), world.end_effector()
        if float(np.linalg.norm(target - hand)) <= trigger.distance_m:
            return True
        way = target + _ABOVE_M - hand
        world.step([*(way / max(_STEP_M, float(abs(way).max()))), 0.0, 0.0, 0.0, NOOP_ACTION[-1]])
    return False


def _drift(world: World) -> dict[str, tuple[float, float]]:
    """How far every object in the scene moves, and how far down, while the world is held still, m."""
    start = _positions(world)
    _hold(world, _HOLD_STEPS)
    end = _positions(world)
    return {
        name: (float(np.linalg.norm(end[name] - position)), float(position[2] - end[name][2]))
        for name, position in start.items()
    }


def _positions(world: World) -> dict[str, Array]:
    return {
        name: world.position(name)
        for name, entity in world.entities.items()
        if entity.kind == "object" and name not in world.parked
    }


def _overlaps(world: World, entities: Iterable[str], touching: dict[str, set[str]]) -> Iterable[str]:
    for name in entities:
        new = set(world.contacts(name)) - touching[name] - {world.entities[name].support}
        if new:
            yield f"{name} touches {', '.join(sorted(new))}"


def _too_close(world: World, name: str, touching: set[str]) -> Iterable[str]:
    import mujoco

    model = world.model
    roots = model.body_rootid[model.geom_bodyid]
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    root_of = {other: int(model.body_rootid[model.body(e.body).id]) for other, e in world.entities.items()}
    mine = np.flatnonzero(solid & (roots == root_of[name]))
    exempt = {root_of[other] for other in (*touching, world.entities[name].support) if other in root_of}
    owners = {root: other for other, root in root_of.items()}
    for root in sorted({int(root) for root in roots[solid]} - exempt - {0, root_of[name]}):
        gaps = (
            mujoco.mj_geomDistance(model, world.data, int(geom), int(other), MIN_CLEARANCE_M, None)
            for geom in mine
            for other in np.flatnonzero(solid & (roots == root))
        )
        gap = min(gaps)
        if gap < MIN_CLEARANCE_M:
            yield f"{name} is {gap * 1000:.0f} mm from {owners.get(root, 'the robot')}"


def _out_of_reach(world: World, change: Change) -> Iterable[str]:
    names = [world.model.body(i).name for i in range(world.model.nbody)]
    if change.operation != "move_object" or _BASE_BODY not in names:
        return
    base = world.data.body(_BASE_BODY).xpos
    for factor in change.factors:
        name = factor.removeprefix("pose:")
        away = hypot(*(world.position(name) - base)[:2])
        if away > MAX_REACH_M:
            yield f"{name} ends {away:.2f} m from the robot's base"
