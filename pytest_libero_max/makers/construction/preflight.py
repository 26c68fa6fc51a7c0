"""Check in the simulator whether a case is physically sensible, before any policy is scored on it.

An event that moves something is applied twice: at the start, and where it will happen, with the hand within
the trigger distance; any other only there. The world is held still afterwards, once with and once without the
event, and the difference decides. Pictures are examined where the event will happen.
Limits of settling and of the image are those of the benchmark's authors; clearance, reach, visibility and the
situation of the trigger are checked in addition. The hand comes to the trigger on fixed ways that depend on
no policy, so no policy's skill decides which cases pass.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from math import dist, hypot
from typing import Literal, get_args

import numpy as np
from msgspec import Struct

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.changes import Change, change_from_dict
from pytest_libero_max.errors import SimulatorError
from pytest_libero_max.events.approach import WAYS, approach, begin, hold, proximity_of
from pytest_libero_max.makers.construction.visibility import (
    IMAGE_SIZE,
    MIN_PIXELS,
    Pixels,
    Sight,
    look,
    pixels_of,
    sights,
)
from pytest_libero_max.substrates.registry import contents_of
from pytest_libero_max.worlds.contract import Image, OnMujoco, World, alterable, on_mujoco
from pytest_libero_max.worlds.robot import MujocoRobot

MAX_SHIFT_M = 0.02
"""Largest drift, m, beyond that without the event, while the world is held still."""

MAX_DROP_M = 0.01
"""Largest sinking, m, beyond that without the event."""

MIN_CLEARANCE_M = 0.01
"""Least distance, m, of moved or added things from all but their support: room for a fingertip's edge."""

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
"""Checks that a case can fail."""

CHECKS: tuple[Check, ...] = get_args(Check)

_HOLD_AT_START_S = 0.1  # the authors' 50 simulation steps
_HOLD_AT_TRIGGER_S = 1.0


class Problem(Struct, frozen=True, array_like=True):
    """A check that a case fails."""

    check: Check
    detail: str

    def __str__(self) -> str:
        return self.detail


class Preflight(Struct, frozen=True):
    """Result of a preflight of a case."""

    problems: tuple[Problem, ...]
    """The checks that it fails; it passes where there are none."""
    sights: tuple[Sight, ...] = ()
    """Visibility of target and receptacle at the event; empty where it was not tried there."""

    @property
    def passed(self) -> bool:
        """True if the case can be used."""
        return not self.problems


def preflight(world: World, case: Case) -> Preflight:
    """Try a case's event at the start and at its trigger.

    The conditions: the hand comes within the trigger distance; neither the approach nor the event solves the
    task; objects that the event moves or brings in keep clear of everything, are seen by a camera, stay where
    they were put, keep the contact with their support and reach no new one; nothing else is pushed; a moved
    target or receptacle stays within reach; a camera still sees target and receptacle, if one did before the
    event, unless the event turns the camera itself; the agent's camera sees a scene before and after, and the
    event in it; the simulation stays finite.

    Args:
        world: The world that plays the case. It is reset and left anywhere.
        case: The case. An event that moves nothing is tried at its trigger only, and one that does there only
            if nothing was wrong at the start.
    """
    try:
        touched = _touching(world, case)
        if touched:
            begin(world, case)
            preflight = _try_here(world, case, touched, _HOLD_AT_START_S)
            if preflight.problems:
                return preflight
        if approach(world, case) is None:
            trigger = proximity_of(case)
            detail = f"the hand does not come within {trigger.distance_m} m of {trigger.entity}"
            return Preflight((Problem("trigger", f"{detail} on any of {len(WAYS)} ways"),))
        return _try_here(world, case, touched, _HOLD_AT_TRIGGER_S, with_images=True)
    except SimulatorError as error:
        return Preflight((Problem("simulation", f"the simulation breaks: {error}"),))


def _moved(change: Change) -> list[str]:
    return sorted(factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:"))


def _touching(world: World, case: Case) -> dict[str, set[str]]:
    """Contacts before the setup of each entity that the event moves or brings in."""
    world.reset(case.init_state_index)
    return {name: set(world.contacts(name)) for name in _moved(change_from_dict(case.event.change))}


def _settling(
    world: World, case: Case, steps: int, names: Iterable[str]
) -> tuple[dict[str, tuple[float, float]], frozenset[str]]:
    """Movement of everything, and downwards, in the first steps of the episode without the setup, m.

    The initial states of LIBERO-Object begin with objects a little inside the floor, which throws them up: an
    event that brings them back there is not worse than the task itself at the same moment.

    Returns:
        The movements by name, and which of the named entities are off their support after these steps.
    """
    world.reset(case.init_state_index)
    drift = _drift(world, steps)
    return drift, frozenset(name for name in names if not _is_supported(world, name))


def _is_supported(world: World, name: str) -> bool:
    return world.entities[name].support in world.contacts(name)


def _try_here(
    world: World, case: Case, touched: Mapping[str, set[str]], held_s: float, *, with_images: bool = False
) -> Preflight:
    """Apply the event to the world as it is, check, hold still, check again.

    Defects of the geometry are found at once. The rest is examined only where there are none, and pictures
    only at the trigger.
    """
    change = change_from_dict(case.event.change)
    entities = _moved(change)
    if world.succeeded():
        return Preflight((Problem("solved", "the task is solved before the event"),))
    touching = {
        name: touched[name] | (set() if name in world.parked else set(world.contacts(name)))
        for name in entities
    }
    stood_near = {name: _stood_near(on_mujoco(world), name) for name in entities}
    here = world.snapshot()
    places = _positions(world)
    change.apply(alterable(world))
    moving = bool(entities) and _positions(world) == places  # it sets in motion what stays where it was
    problems = [
        problem
        for name in entities
        for problem in _too_close(on_mujoco(world), name, touching[name], stood_near[name])
    ]
    problems += _out_of_reach(on_mujoco(world), change)
    problems += _out_of_room(world, case, change)
    if world.succeeded():
        problems.append(Problem("solved", "the event solves the task"))
    if problems:
        return Preflight(tuple(problems))
    seen_by: tuple[Sight, ...] = ()
    if with_images:
        seen_after, image_after = look(world), _image(world)
        world.restore(here)
        seen_by = sights(world, case, look(world), seen_after)
        problems += _hidden(change, entities, seen_after, seen_by)
        if not moving:
            problems += _image_problems(_image(world), image_after)
    if entities:
        world.restore(here)
        steps = round(held_s * world.robot.control_hz)
        problems += _motion_problems(world, case, change, touching, steps, with_images and moving)
    return Preflight(tuple(dict.fromkeys(problems)), seen_by)


def _hidden(
    change: Change, entities: Iterable[str], seen: Pixels, seen_by: Iterable[Sight]
) -> Iterable[Problem]:
    """Entities that no camera shows after the event: those it moves or brings in, and those seen before it.

    The authors keep every shift of a camera, and so do we.
    """
    if change.operation == "shift_camera":
        return
    lost = {sight.entity for sight in seen_by if sight.seen_before and not sight.seen_after}
    for name in sorted({*lost, *(name for name in entities if max(pixels_of(name, seen)) < MIN_PIXELS)}):
        pixels = ", ".join(map(str, pixels_of(name, seen)))
        yield Problem("view", f"{name} has {pixels} pixels in the cameras after the event")


def _motion_problems(
    world: World, case: Case, change: Change, touching: Mapping[str, set[str]], steps: int, with_image: bool
) -> Iterable[Problem]:
    """Problems while the world is held still after the event, which do not occur without it."""
    here = world.snapshot()
    calm = _drift(world, steps)
    calm_image = _image(world) if with_image else None
    loose: frozenset[str] = frozenset()
    if case.event.setup:
        settling, loose = _settling(world, case, steps, touching)
        calm = {**settling, **calm}
    world.restore(here)
    change.apply(alterable(world))
    disturbed = _drift(world, steps)
    if calm_image is not None:
        yield from _image_problems(calm_image, _image(world))
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
    for name in touching:
        support = world.entities[name].support
        if support in touching[name] and name not in loose and not _is_supported(world, name):
            yield Problem("support", f"{name} has lost its support {support}")
    yield from _overlaps(world, touching)


def _image(world: World) -> Image:
    camera = world.robot.cameras[0]
    image: Image = world.observe([camera], IMAGE_SIZE)[f"{camera}_image"]
    return image


def _image_problems(before: Image, after: Image) -> Iterable[Problem]:
    for image, when in ((before, "before"), (after, "after")):
        mean, deviation = float(image.mean()), float(image.std())
        if mean < MIN_BRIGHTNESS or deviation < MIN_CONTRAST:
            detail = f"the image {when} the event has mean {mean:.1f} and deviation {deviation:.1f}"
            yield Problem("image", detail)
    if np.array_equal(before, after):
        yield Problem("no_change", "the agent's camera sees nothing of the event")


def _drift(world: World, steps: int) -> dict[str, tuple[float, float]]:
    """Movement of every object in the scene, and downwards, while the world is held still, m."""
    start = _positions(world)
    hold(world, steps)
    return _moves(start, _positions(world))


def _moves(
    start: Mapping[str, tuple[float, ...]], end: Mapping[str, tuple[float, ...]]
) -> dict[str, tuple[float, float]]:
    return {name: (dist(position, end[name]), position[2] - end[name][2]) for name, position in start.items()}


def _positions(world: World) -> dict[str, tuple[float, ...]]:
    return {
        name: tuple(world.position(name).tolist())
        for name, entity in world.entities.items()
        if entity.kind == "object" and name not in world.parked
    }


def _overlaps(world: World, touching: Mapping[str, set[str]]) -> Iterable[Problem]:
    for name in touching:
        new = set(world.contacts(name)) - touching[name] - {world.entities[name].support}
        if new:
            yield Problem("contact", f"{name} touches {', '.join(sorted(new))}")


def _too_close(
    world: OnMujoco, name: str, touching: set[str], stood_near: Collection[int]
) -> Iterable[Problem]:
    roots = _roots(world)
    owners = {root: other for other, root in roots.items()}
    exempt = {roots[other] for other in (*touching, world.entities[name].support) if other in roots}
    for root, gap in _neighbours(world, name).items():
        if root not in exempt and root not in stood_near:
            detail = f"{name} is {gap * 1000:.0f} mm from {owners.get(root, 'the robot')}"
            yield Problem("clearance", detail)


def _stood_near(world: OnMujoco, name: str) -> frozenset[int]:
    """Return the roots that a fixture is built close to: it has no contact with them that would say so."""
    return frozenset(_neighbours(world, name) if world.entities[name].kind == "fixture" else ())


def _neighbours(world: OnMujoco, name: str) -> dict[int, float]:
    """Return the root bodies closer to an entity than the least clearance, with their distances, m."""
    import mujoco

    model, own = world.model, _roots(world).get(name)
    if own is None:
        return {}  # a mark, which nothing can touch
    roots = model.body_rootid[model.geom_bodyid]
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    mine = np.flatnonzero(solid & (roots == own))
    gaps = {
        root: min(
            (
                mujoco.mj_geomDistance(model, world.data, int(geom), int(other), MIN_CLEARANCE_M, None)
                for geom in mine
                for other in np.flatnonzero(solid & (roots == root))
            ),
            default=MIN_CLEARANCE_M,
        )
        for root in sorted({int(root) for root in roots[solid]} - {0, own})
    }
    return {root: gap for root, gap in gaps.items() if gap < MIN_CLEARANCE_M}


def _roots(world: OnMujoco) -> dict[str, int]:
    import mujoco

    bodies = {
        name: mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_BODY, entity.body)
        for name, entity in world.entities.items()
    }
    return {name: int(world.model.body_rootid[body]) for name, body in bodies.items() if body >= 0}


def _out_of_reach(world: OnMujoco, change: Change) -> Iterable[Problem]:
    robot = world.robot
    if change.operation != "move_object" or not isinstance(robot, MujocoRobot):
        return
    if robot.base_body not in (world.model.body(number).name for number in range(world.model.nbody)):
        return
    base = world.data.body(robot.base_body).xpos
    for name in _moved(change):
        away = hypot(*(world.position(name) - base)[:2])
        if away > robot.reach_m:
            yield Problem("reach", f"{name} ends {away:.2f} m from the robot's base")


def _out_of_room(world: World, case: Case, change: Change) -> Iterable[Problem]:
    """Things that end where their task never puts them; source variations put them elsewhere."""
    if change.operation != "move_object" or not case.unmodified:
        return
    rooms = contents_of(case.suite, case.task_index).rooms
    for name in _moved(change):
        x, y = world.position(name)[:2].tolist()
        if name in rooms and not rooms[name].holds(x, y):
            yield Problem("reach", f"{name} ends at ({x:.2f}, {y:.2f}) m, where its task never puts it")
