"""LIBERO-Plus's category Objects Layout: added objects, and shifted ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.poses import MoveObject, PutObject
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.substrates.embedded.catalogue.floorplan import (
    Floorplan,
    Footprint,
    floorplan,
    footprint_at,
    owner_of,
    start_of,
)
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.variation import share, uniform
from pytest_libero_max.tasks.libero_tasks import Task, category_of

CONFOUNDERS = (
    "alphabet_soup",
    "bbq_sauce",
    "butter",
    "chocolate_pudding",
    "cookies",
    "cream_cheese",
    "glazed_rim_porcelain_ramekin",
    "ketchup",
    "milk",
    "orange_juice",
    "salad_dressing",
    "tomato_sauce",
)
"""Categories that may be added to a scene that has nothing of them."""

SHIFT_M_PER_LEVEL = MappingProxyType(
    {
        "libero_spatial": 0.01,
        "libero_object": 0.03,
        "libero_goal": 0.02,
        "libero_10": 0.01,
    }
)
"""Radius of the disc in which things are shifted, for each level: LIBERO-Plus's own."""

LEVELS = 5

# Where LIBERO-Plus adds its objects, m, world.
_SLOTS: Mapping[str, tuple[tuple[float, float], ...]] = MappingProxyType(
    {
        "libero_spatial": ((-0.4, 0.4), (-0.4, 0.2), (0.25, -0.15), (0.25, 0.2), (0.25, 0.0)),
        "libero_object": ((0.3, 0.2), (-0.3, 0.25), (0.3, 0.0), (-0.3, -0.25), (0.3, -0.2)),
        "libero_goal": ((0.25, 0.2), (0.25, -0.15), (0.25, 0.0), (0.05, 0.3), (-0.3, 0.4)),
        "libero_10": (
            (0.2, 0.15),
            (0.2, -0.05),
            (-0.3, 0.2),
            (-0.4, -0.2),
            (-0.45, -0.3),
            (0.2, -0.15),
            (-0.25, -0.1),
            (0.0, -0.2),
            (-0.2, 0.3),
            (0.2, -0.25),
            (0.2, 0.2),
            (0.0, 0.25),
            (-0.3, -0.25),
            (0.1, -0.2),
            (-0.4, 0.25),
            (-0.25, 0.15),
        ),
    }
)
# Where none of those is free: the nodes of a grid, m.
_GRID = tuple((x / 100, y / 100) for x in range(-40, 36, 4) for y in range(-40, 44, 4))
_ROOM_M = 0.03
_NEAR_M = 0.012
_ATTEMPTS = 400


def added_count(number: int) -> int:
    """Return the number of objects in the ``number``-th set of confounders, from 1."""
    return math.ceil(number / 6)


def added_objects(task: Task, number: int) -> tuple[list[tuple[str, str]], tuple[Json, ...]]:
    """Return the ``number``-th set of confounders, from 1; each six sets have one object more, up to five.

    Returns:
        Instance and category of each, and the changes that put them on the surface.
    """
    plan = floorplan(task.suite, task.index)
    present = {category_of(name) for name in (*task.objects, *task.fixtures)}
    free = [name for name in CONFOUNDERS if name not in present]
    ranked = sorted(free, key=lambda name: share(task.name, "add", number, name))
    taken: list[Footprint] = []
    extras, changes = [], []
    for name in ranked[: added_count(number)]:
        x, y = _free_spot(plan, name, taken, (task.name, "add", number, name))
        taken.append(footprint_at(name, x, y, math.pi / 4))
        instance = f"{name}_1"
        yaw = uniform(-30.0, 30.0, task.name, "add", number, name, "yaw")
        extras.append((instance, name))
        changes.append(PutObject(instance, plan.arena.surface, (x, y), yaw_degrees=yaw).to_dict())
    return extras, tuple(changes)


def _free_spot(
    plan: Floorplan, name: str, taken: list[Footprint], seed: tuple[object, ...]
) -> tuple[float, float]:
    """Return the first free slot in an order of its own; a node of the grid where none is free."""
    for spots in (_SLOTS[plan.task.suite], _GRID):
        for x, y in sorted(spots, key=lambda spot: share(*seed, *spot)):
            # Turned by an eighth, a rectangle covers about what it would at any smaller angle.
            footprint = footprint_at(name, x, y, math.pi / 4)
            crowded = any(footprint.gap(other) < _ROOM_M for other in taken)
            if not crowded and plan.inside(footprint) and plan.gap(footprint) >= _ROOM_M:
                return x, y
    raise ManifestError(f"{plan.task.name} has no room for {name!r}: add fewer confounders.")


def shifted_objects(task: Task, level: int, sample: int) -> tuple[Json, ...]:
    """Everything that stands free shifted within a disc that grows with the level, the target farthest.

    Objects that stand on others are moved with them.
    """
    plan = floorplan(task.suite, task.index)
    radius = SHIFT_M_PER_LEVEL[task.suite] * level
    target = plan.carrier(target_of(task))
    now = dict(plan.standing)
    changes = []
    for name in plan.standing:
        if category(category_of(name)).fixture:
            continue
        dx, dy = _shift(plan, name, now, radius, (task.name, "level", level, sample), name == target)
        now[name] = now[name].moved(dx, dy)
        for moved in (name, *plan.riders(name)):
            changes.append(MoveObject(moved, (dx, dy, 0.0)).to_dict())
    return tuple(changes)


def _shift(
    plan: Floorplan,
    name: str,
    now: dict[str, Footprint],
    radius: float,
    seed: tuple[object, ...],
    target: bool,
) -> tuple[float, float]:
    """Return a shift that leaves things as far apart as they were, or far enough."""
    others = [other for key, other in now.items() if key != name]
    before = min((now[name].gap(other) for other in others), default=math.inf)
    x, y = start_of(plan.task, name)
    for attempt in range(_ATTEMPTS):
        part = share(*seed, name, attempt, "part")
        away = radius * math.sqrt(0.49 + 0.51 * part if target else part)
        angle = 2 * math.pi * share(*seed, name, attempt, "angle")
        dx, dy = round(away * math.cos(angle), 6), round(away * math.sin(angle), 6)
        footprint = now[name].moved(dx, dy)
        gap = min((footprint.gap(other) for other in others), default=math.inf)
        # Away from the robot's reach nothing is moved, so that the task stays feasible.
        near = plan.reachable(x + dx, y + dy) or not plan.reachable(x, y)
        if gap >= min(before, _NEAR_M) and near:
            return dx, dy
    return 0.0, 0.0


def target_of(task: Task) -> str:
    """Entity that a task is about: the first movable object of its goal, or the owner of what is opened."""
    for fact in task.goal:
        if fact.subject in task.objects:
            return fact.subject
    return owner_of(task, task.goal[0].subject)
