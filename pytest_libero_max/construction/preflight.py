"""Check in the simulator whether a case is physically sensible, before any policy is scored on it.

The event is applied twice: at the start, and in the very situation in which it will happen, with the hand
on its way to the trigger entity. Both times the world is held still afterwards, once with and once without
the event, and what differs decides. Limits of settling and of the image are those of the benchmark's authors;
clearance, reach, view and the situation of the trigger are checked in addition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import hypot, tan
from typing import Literal, get_args

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.changes import Change, change_from_dict
from pytest_libero_max.errors import SimulatorError
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.worlds.contract import (
    CAMERAS,
    CONTROL_HZ,
    NOOP_ACTION,
    Array,
    Image,
    World,
    WorldState,
)

MAX_SHIFT_M = 0.02
"""How much farther than without the event anything may drift while the world is held still."""

MAX_DROP_M = 0.01
"""How much farther than without the event anything may sink."""

MIN_CLEARANCE_M = 0.01
"""How far what an event moves or brings in must be from all but its support: room for a fingertip's edge."""

MAX_REACH_M = 0.80
"""Horizontal distance from the robot's base within which a moved target or receptacle must end: about
that of the farthest target in LIBERO's own tasks, with the tool pointing down."""

MIN_BRIGHTNESS, MIN_CONTRAST = 8.0, 5.0
"""Smallest mean and standard deviation of all values of an image, 0 to 255."""

Check = Literal[
    "substrate",
    "trigger",
    "solved",
    "clearance",
    "reach",
    "settling",
    "support",
    "contact",
    "view",
    "image",
    "no_change",
    "simulation",
]
"""What a case can fail at."""

CHECKS: tuple[Check, ...] = get_args(Check)

Approach = Callable[[World, Case], bool]
"""Brings a world from anywhere to the step at which the case's event fires; False if it never does."""

_IMAGE_SIZE = 256
_HOLD_AT_START = 2  # control steps: the authors' 50 simulation steps
_HOLD_AT_TRIGGER = CONTROL_HZ
_APPROACH_STEPS = 100
_ABOVE_M = (0.0, 0.0, 0.1)
_STEP_M = 0.05  # what the controller makes of a full translation action
_BASE_BODY = "robot0_base"


@dataclass(frozen=True)
class Problem:
    """A check that a case fails.

    Attributes:
        check: What it failed at.
        detail: What was seen, with names and numbers.
    """

    check: Check
    detail: str

    def __str__(self) -> str:
        return self.detail


def problems(world: World, case: Case, approach: Approach | None = None) -> tuple[Problem, ...]:
    """The checks that a case fails; empty if it passes.

    The conditions: the hand comes within the trigger distance; neither the approach nor the event solves the
    task; what the event moves or brings in keeps clear of everything, is seen by a camera, stays where it was
    put, keeps the contact with its support and reaches no new one; nothing else is pushed; a moved target or
    receptacle stays within reach; the agent's camera sees a scene before and after, and the event in it; the
    simulation stays finite.

    Args:
        world: The world that plays the case. It is reset; if the case passes, it is left where the event
            fires, without the event.
        case: The case.
        approach: How the hand gets there from the initial state; by default :func:`straight_approach`. The
            trigger is looked at only if nothing was wrong at the start.
    """
    approach = approach or straight_approach
    try:
        before = _look_before(world, case)
        _begin(world, case)
        found = tuple(_problems_here(world, case, before, _HOLD_AT_START))
        if found:
            return found
        if not approach(world, case):
            trigger = case.event.trigger
            ended = " before the task is solved" if world.succeeded() else ""
            detail = f"the hand does not come within {trigger.distance_m} m of {trigger.entity}{ended}"
            return (Problem("trigger", detail),)
        return tuple(_problems_here(world, case, before, _HOLD_AT_TRIGGER))
    except SimulatorError as error:
        return (Problem("simulation", f"the simulation breaks: {error}"),)


def straight_approach(world: World, case: Case) -> bool:
    """Start the case and drive the hand in a straight line to above the trigger entity.

    Returns:
        Whether it came within the trigger distance.
    """
    _begin(world, case)
    trigger = Proximity(case.event.trigger.entity, case.event.trigger.distance_m)
    for _ in range(_APPROACH_STEPS):
        if trigger.reached(world):
            return True
        way = world.position(trigger.entity) + _ABOVE_M - world.end_effector()
        world.step([*(way / max(_STEP_M, float(abs(way).max()))), 0.0, 0.0, 0.0, NOOP_ACTION[-1]])
    return False


@dataclass(frozen=True)
class _Before:
    """The scene without the event, as far as it concerns the entities that the event moves or brings in.

    Attributes:
        touching: What each touched before the setup.
        settling: How far what the setup takes away would have moved in its place, and how far down, m. The
            initial states of LIBERO-Object begin with objects a little inside the floor, which throws them
            up; an event that brings them back there is not worse than the task itself.
    """

    touching: Mapping[str, set[str]]
    settling: Mapping[str, tuple[float, float]]


def _look_before(world: World, case: Case) -> _Before:
    world.reset(case.init_state_index)
    moved = _moved(change_from_dict(case.event.change))
    touching = {name: set(world.contacts(name)) for name in moved}
    settling = _drift(world, _HOLD_AT_TRIGGER) if case.event.setup else {}
    return _Before(touching, settling)


def _begin(world: World, case: Case) -> None:
    world.reset(case.init_state_index)
    for raw in case.event.setup:
        change_from_dict(raw).apply(world)
    _hold(world, SETTLE_STEPS)


def _moved(change: Change) -> list[str]:
    return sorted(factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:"))


def _problems_here(world: World, case: Case, before: _Before, steps: int) -> list[Problem]:
    """Apply the event to the world as it is, check, hold still, check again; then restore the world."""
    here = world.snapshot()
    found = list(_apply_and_look(world, case, before, steps))
    world.restore(here)
    return list(dict.fromkeys(found))


def _apply_and_look(world: World, case: Case, before: _Before, steps: int) -> Iterable[Problem]:
    change = change_from_dict(case.event.change)
    entities = _moved(change)
    touching = {
        name: before.touching[name] | (set() if name in world.parked else set(world.contacts(name)))
        for name in entities
    }
    if world.succeeded():
        yield Problem("solved", "the task is solved before the event")
        return
    if not entities:  # nothing that it does can move anything
        image = _look(world)
        change.apply(world)
        yield from _image_problems(image, _look(world))
        return
    image, here = _look(world), world.snapshot()
    calm = {**before.settling, **_drift(world, steps)}
    world.restore(here)
    places = _positions(world)
    change.apply(world)
    now = _positions(world)
    if places.keys() == now.keys() and all((now[name] == places[name]).all() for name in now):
        yield from _image_problems(*_looks_later(world, here, steps))  # it set things in motion
    else:
        yield from _image_problems(image, _look(world))
    for name in entities:
        yield from _too_close(world, name, touching[name])
        yield from _out_of_view(world, name)
    yield from _out_of_reach(world, change)
    disturbed = _drift(world, steps)
    if world.succeeded():
        yield Problem("solved", "the event solves the task")
    for name, (shift, drop) in disturbed.items():
        calm_shift, calm_drop = calm.get(name, (0.0, 0.0))
        sinks = max(0.0, drop) - max(0.0, calm_drop)
        if shift - calm_shift > MAX_SHIFT_M or sinks > MAX_DROP_M:
            detail = (
                f"{name} moves by {shift * 1000:.0f} mm, {drop * 1000:.0f} mm of it down, after the event"
            )
            yield Problem("settling", detail)
    for name in entities:
        support = world.entities[name].support
        if support in touching[name] and support not in world.contacts(name):
            yield Problem("support", f"{name} has lost its support {support}")
    yield from _overlaps(world, entities, touching)


def _hold(world: World, steps: int) -> None:
    for _ in range(steps):
        world.step(NOOP_ACTION)


def _look(world: World) -> Image:
    image: Image = world.observe(CAMERAS[:1], _IMAGE_SIZE)[f"{CAMERAS[0]}_image"]
    return image


def _looks_later(world: World, calm: WorldState, steps: int) -> tuple[Image, Image]:
    """What is seen after the world was held still for some steps: from ``calm``, and from now on."""
    changed = world.snapshot()
    _hold(world, steps)
    after = _look(world)
    world.restore(calm)
    _hold(world, steps)
    before = _look(world)
    world.restore(changed)
    return before, after


def _image_problems(before: Image, after: Image) -> Iterable[Problem]:
    for image, when in ((before, "before"), (after, "after")):
        mean, deviation = float(image.mean()), float(image.std())
        if mean < MIN_BRIGHTNESS or deviation < MIN_CONTRAST:
            detail = f"the image {when} the event has mean {mean:.1f} and deviation {deviation:.1f}"
            yield Problem("image", detail)
    if np.array_equal(before, after):
        yield Problem("no_change", "the agent's camera sees nothing of the event")


def _drift(world: World, steps: int) -> dict[str, tuple[float, float]]:
    """How far every object in the scene moves, and how far down, while the world is held still, m."""
    start = _positions(world)
    _hold(world, steps)
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


def _overlaps(world: World, entities: Iterable[str], touching: Mapping[str, set[str]]) -> Iterable[Problem]:
    for name in entities:
        new = set(world.contacts(name)) - touching[name] - {world.entities[name].support}
        if new:
            yield Problem("contact", f"{name} touches {', '.join(sorted(new))}")


def _too_close(world: World, name: str, touching: set[str]) -> Iterable[Problem]:
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
            detail = f"{name} is {gap * 1000:.0f} mm from {owners.get(root, 'the robot')}"
            yield Problem("clearance", detail)


def _out_of_view(world: World, name: str) -> Iterable[Problem]:
    """Whether the entity's place is outside of the picture of every camera of a policy."""
    model, data, position = world.model, world.data, world.position(name)
    for camera in CAMERAS:
        number = model.camera(camera).id
        right, up, back = data.cam_xmat[number].reshape(3, 3).T @ (position - data.cam_xpos[number])
        edge = -back * tan(np.radians(model.cam_fovy[number]) / 2)
        if back < 0 and max(abs(right), abs(up)) <= edge:
            return
    yield Problem("view", f"{name} is in the picture of no camera after the event")


def _out_of_reach(world: World, change: Change) -> Iterable[Problem]:
    names = [world.model.body(i).name for i in range(world.model.nbody)]
    if change.operation != "move_object" or _BASE_BODY not in names:
        return
    base = world.data.body(_BASE_BODY).xpos
    for name in _moved(change):
        away = hypot(*(world.position(name) - base)[:2])
        if away > MAX_REACH_M:
            yield Problem("reach", f"{name} ends {away:.2f} m from the robot's base")
