"""LIBERO-PRO's search for a free place: its candidates in its order, and its test of whether a place is free.

Nothing is drawn: the requested place comes first, then others around it, and the first that will do is
taken. Objects are circles of a nominal radius, and of contacts only those that are pressed in count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.contract import Array

import mujoco  # isort: skip - the rooms above have settled its backend

if TYPE_CHECKING:
    from pytest_libero_max.substrates.libero.world import LiberoWorld

_MOST_CANDIDATES = 32
_REACH_M = 0.6
"""Places are within this distance of the origin along x and along y."""
_GAP_M = 0.01
_LAYER_M = 0.04
"""Objects farther apart in height cannot be in each other's way."""
_RADIUS_M = 0.04
"""Radius of entities that declare none: fixtures."""
_SHORTEST_M = 0.06
_PRESSED_M = 0.001
_MAY_BE_PRESSED = ("table_collision", "floor")

_AROUND = (0.0, np.pi / 2, -np.pi / 2, np.pi, np.pi / 4, -np.pi / 4, 3 * np.pi / 4, -3 * np.pi / 4)
_AWAY = ((-0.08, 0.08), (-0.10, 0.06), (-0.06, 0.10), (0.00, 0.10), (-0.10, 0.00))
_FANNED = (0.0, -0.16, 0.16, -0.32, 0.32, -0.48, 0.48)
_WIDEST_FAN = 1.2
_FORWARD_M = (0.075, 0.095, 0.12, 0.16, 0.20, 0.24)
_SIDEWAYS_M = (0.0, -0.065, 0.065, -0.10, 0.10)


def shifts(requested: Sequence[float], shortest: float = 0.0) -> list[Array]:
    """(2,) each, m: the requested shift, at least ``shortest`` long, then others all around."""
    x, y = requested
    angle = float(np.arctan2(y, x))
    radius = max(float(np.linalg.norm(requested)), shortest)
    radii = (radius, max(radius * 0.90, shortest, _SHORTEST_M), radius * 1.10, radius * 1.25)
    steps = [_polar(radius, angle)]
    steps += [_polar(length, angle + turn) for length in radii for turn in _AROUND]
    fallbacks = [np.array(away) for away in _AWAY]
    if shortest > 0.0:
        length = max(shortest, _SHORTEST_M)
        fallbacks = [away / float(np.linalg.norm(away)) * length for away in fallbacks]
    return _distinct(steps + fallbacks)


def offsets(requested: Sequence[float], front: Sequence[float]) -> list[Array]:
    """(2,) each, m: the requested offset from an entity, then others in a fan towards ``front``."""
    wanted, ahead = np.array(requested, dtype=np.float64), np.array(front, dtype=np.float64)
    facing = float(np.arctan2(ahead[1], ahead[0]))
    length, angle = float(np.linalg.norm(wanted)), float(np.arctan2(wanted[1], wanted[0]))
    apart = float(np.arctan2(np.sin(angle - facing), np.cos(angle - facing)))
    if length < _SHORTEST_M:
        length, angle = 0.10, facing
    elif abs(apart) > _WIDEST_FAN:
        angle = facing
    radii = (max(length, 0.12), max(length + 0.04, 0.16), max(length + 0.08, 0.20))
    ahead = ahead / float(np.linalg.norm(ahead))
    side = np.array([-ahead[1], ahead[0]])
    return _distinct(
        [
            wanted,
            *(_polar(radius, angle + turn) for radius in radii for turn in _FANNED),
            *(ahead * forward + side * sideways for forward in _FORWARD_M for sideways in _SIDEWAYS_M),
        ]
    )


def _polar(radius: float, angle: float) -> Array:
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def _distinct(candidates: Iterable[Array]) -> list[Array]:
    distinct: dict[tuple[float, ...], Array] = {}
    for candidate in candidates:
        distinct.setdefault(tuple(np.round(candidate, 4).tolist()), candidate)
    return list(distinct.values())[:_MOST_CANDIDATES]


def put_where_free(
    world: LiberoWorld,
    entity: str,
    candidates: Iterable[Array],
    pose: tuple[Array, Array],
    suits: Callable[[Array], bool] = lambda place: True,
) -> None:
    """Put an entity at the first place that is free, or raise SubstrateError.

    Args:
        candidates: (2,) each, m, world frame, in the order in which they are tried.
        pose: Height and orientation it is to have: a position of which x and y are not used, and wxyz.
        suits: Further condition on a place, tried before anything is moved.
    """
    before = world.pose(entity)
    tried = 0
    for place in candidates:
        tried += 1
        if not (np.abs(place) <= _REACH_M).all() or not suits(place) or _crowded(world, entity, place):
            continue
        world.place(entity, (*place, pose[0][2]), pose[1])
        if not any(entity in pair for pair in overlapping(world)) and not pressed(world, entity):
            return
        world.place(entity, *before)
    raise SubstrateError(
        f"{world.scene}: LIBERO-PRO finds no free place for {entity!r}; it tries {tried}. This initial state "
        "cannot be varied so: leave the case out, or choose another initial state."
    )


def require_free(world: LiberoWorld, *entities: str) -> None:
    """Check the whole scene after something was moved, or raise SubstrateError."""
    pairs = [" and ".join(pair) for pair in overlapping(world)]
    pairs += [f"{entity} and what it touches" for entity in entities if pressed(world, entity)]
    if pairs:
        raise SubstrateError(
            f"{world.scene}: {', '.join(pairs)} are in each other's way, which LIBERO-PRO refuses. This "
            "initial state cannot be varied so: leave the case out, or choose another initial state."
        )


def overlapping(world: LiberoWorld) -> list[tuple[str, str]]:
    """Pairs of objects whose circles overlap and that the task does not put upon or into each other."""
    facts = (*world.problem["initial_state"], *world.problem["goal_state"])
    stacked = {frozenset(fact[1:]) for fact in facts if fact[0].lower() in ("on", "in")}
    names = sorted(objects(world))
    return [
        (one, other)
        for number, one in enumerate(names)
        for other in names[number + 1 :]
        if frozenset((one, other)) not in stacked and _overlap(world, one, world.position(one)[:2], other)
    ]


def pressed(world: LiberoWorld, entity: str) -> bool:
    """Return True if an entity is pressed into something named that is not the table or the floor."""
    contact = world.data.contact
    own = set(world.geoms(entity).tolist())
    for geoms, distance in zip(contact.geom, contact.dist, strict=True):
        if distance < -_PRESSED_M and own.intersection(geoms.tolist()):
            names = [mujoco.mj_id2name(world.model, mujoco.mjtObj.mjOBJ_GEOM, geom) or "" for geom in geoms]
            if all(names) and not any(word in name.lower() for name in names for word in _MAY_BE_PRESSED):
                return True
    return False


def radius(world: LiberoWorld, entity: str) -> float:
    """Nominal radius of an entity, m."""
    nominal = world.radius(entity)
    return _RADIUS_M if nominal is None or nominal <= 0.0 else nominal


def objects(world: LiberoWorld) -> list[str]:
    """Return the movable objects."""
    return [entity.name for entity in world.entities.values() if entity.kind == "object"]


def _crowded(world: LiberoWorld, entity: str, place: Array) -> bool:
    return any(_overlap(world, entity, place, other) for other in objects(world) if other != entity)


def _overlap(world: LiberoWorld, entity: str, place: Array, other: str) -> bool:
    there = world.position(other)
    if abs(float(world.position(entity)[2]) - float(there[2])) > _LAYER_M:
        return False
    nearest = radius(world, entity) + radius(world, other) + _GAP_M
    return float(np.linalg.norm(place - there[:2])) < nearest
