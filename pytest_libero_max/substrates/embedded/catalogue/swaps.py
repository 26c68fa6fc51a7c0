"""Position and start pose: things that change places, and a target that starts elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.poses import MoveObject, PutObject, TurnObject
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.substrates.embedded.catalogue.floorplan import (
    Floorplan,
    Footprint,
    extent,
    floorplan,
    spot_of,
)
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.tasks.libero_tasks import Task, category_of

START_SHIFT_M = (0.17, -0.06)
"""Place where a target starts instead: LIBERO-PRO's own, if there is room."""

START_TURN_DEG = 45.0
FIXTURE_TURN_DEG = 15.0
"""A fixture turned by LIBERO-PRO's 45 degrees would have its drawers or knob out of the arm's reach."""

OCCLUDER = "black_book_occluder_1"
OCCLUDER_CATEGORY = "occluder_book"

_NEAR_M = 0.010
_ANGLES_DEG = tuple(side * degrees / 2 for degrees in range(0, 361, 45) for side in (1, -1))
_RADII = (1.0, 0.9, 1.1, 1.25, 1.5, 0.75, 1.75, 0.6, 0.5)
_NUDGES_M = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.10, 0.12, 0.15, 0.18, 0.22)
_FRONT_M = tuple((x / 100, y / 100) for x in (8, 9, 10, 11, 12, 13, 14, 16) for y in (0, 2, -2, 4, -4, 6, -6))


def exchanged(task: Task, takes_place_of: Mapping[str, str]) -> tuple[Json, ...]:
    """Return the changes by which instances take each other's places, as near to them as there is room.

    Args:
        takes_place_of: Instance by the instance whose place it takes. What rests on something goes along
            with it; what takes the place of such a rider is put down where that was.
    """
    plan = floorplan(task.suite, task.index)
    now = dict(plan.standing)
    changes: list[Json] = []
    puts: list[Json] = []
    for name, other in takes_place_of.items():
        if name in plan.carried or other in plan.carried:
            puts.append(_put(plan, name, other))
            now.pop(name, None)
            if name in plan.carried:
                now[name] = plan.standing[other]
            continue
        (x, y), (goal_x, goal_y) = plan.centre(name), plan.centre(other)
        waiting = [
            mover for mover in takes_place_of if mover != name and now.get(mover) is plan.standing.get(mover)
        ]
        dx, dy = _nudged(plan, name, now, (goal_x - x, goal_y - y), waiting)
        now[name] = now[name].moved(dx, dy)
        changes += _moves((name, *plan.riders(name)), dx, dy)
    # A rider comes down on the surface before its carrier's new load takes its place.
    return (*changes, *sorted(puts, key=lambda put: put["onto"] != plan.arena.surface))


def _put(plan: Floorplan, name: str, other: str) -> Json:
    """Return the change that puts ``name`` where ``other`` was."""
    if other not in plan.carried:
        return PutObject(name, plan.arena.surface, (0.0, 0.0), other).to_dict()
    carrier = plan.carried[other]
    (x, y), (x0, y0) = spot_of(plan.task, other), spot_of(plan.task, carrier)
    return PutObject(name, carrier, (round(x - x0, 6), round(y - y0, 6)), carrier).to_dict()


def _nudged(
    plan: Floorplan,
    name: str,
    now: Mapping[str, Footprint],
    shift: tuple[float, float],
    waiting: Iterable[str],
) -> tuple[float, float]:
    """Return the shift, or the least departure from it that keeps clear of what does not move later."""
    ignoring = {name, *waiting}
    x, y = plan.centre(name)
    for must_be_reachable in (True, False):
        for away in _NUDGES_M:
            for angle in _ANGLES_DEG if away else (0.0,):
                dx = round(shift[0] + away * math.cos(math.radians(angle)), 6)
                dy = round(shift[1] + away * math.sin(math.radians(angle)), 6)
                within = plan.reachable(x + dx, y + dy) or not must_be_reachable
                if within and _clear(now[name].moved(dx, dy), now, ignoring):
                    return dx, dy
    raise ManifestError(f"{plan.task.name}: there is no room for {name} in its new place.")


def _clear(footprint: Footprint, now: Mapping[str, Footprint], ignoring: Iterable[str]) -> bool:
    left_out = set(ignoring)
    return all(footprint.gap(other) >= _NEAR_M for key, other in now.items() if key not in left_out)


def started_elsewhere(task: Task, target: str) -> tuple[Json, ...]:
    """Return the changes by which a target starts elsewhere and turned, together with what carries it."""
    plan = floorplan(task.suite, task.index)
    carrier = plan.carrier(target)
    x, y = plan.centre(carrier)
    others = {key: other for key, other in plan.standing.items() if key != carrier}
    start = plan.standing[carrier]
    if target == carrier and target in task.objects and not start.round:
        # Turned, it takes at most the room that it takes at any angle.
        reach = max(math.hypot(a - x, b - y) for a, b in start.corners())
        start = Footprint(x, y, reach, reach, slack=start.slack, round=True)
    for must_be_seen in (not category(category_of(carrier)).fixture, False):
        for dx, dy in _shifts():
            footprint = start.moved(dx, dy)
            seen = plan.in_view(footprint) or not must_be_seen
            if seen and plan.reachable(x + dx, y + dy) and _clear(footprint, others, ()):
                moves = _moves((carrier, *plan.riders(carrier)), dx, dy)
                turn = FIXTURE_TURN_DEG if target in task.fixtures else START_TURN_DEG
                return (*moves, TurnObject(target, turn).to_dict())
    raise ManifestError(f"{task.name}: there is no room for {target} to start elsewhere.")


def _shifts() -> Iterator[tuple[float, float]]:
    """Yield the shift itself, then turned and at other lengths, the longer ones first."""
    length, direction = math.hypot(*START_SHIFT_M), math.atan2(START_SHIFT_M[1], START_SHIFT_M[0])
    for factor in _RADII:
        for angle in _ANGLES_DEG:
            along = direction + math.radians(angle)
            yield round(length * factor * math.cos(along), 6), round(length * factor * math.sin(along), 6)


def _moves(names: Iterable[str], dx: float, dy: float) -> list[Json]:
    return [MoveObject(name, (dx, dy, 0.0)).to_dict() for name in names]


def occluded(task: Task, target: str) -> tuple[Json, ...]:
    """Return the changes that put the occluder between the target and the camera, as near as there is room.

    Where one movable object is all that stands in its way, that makes room, as LIBERO-PRO has it.
    """
    plan = floorplan(task.suite, task.index)
    carrier = plan.carrier(target)
    for making_room in (False, True):
        for footprint in _in_front(plan, carrier):
            near = [key for key, other in plan.standing.items() if footprint.gap(other) < _NEAR_M]
            if not plan.inside(footprint):
                continue
            if not near:
                return (_put_occluder(plan, carrier, footprint),)
            if making_room and len(near) == 1 and near[0] in task.objects and near[0] != carrier:
                shift = _away(plan, near[0], {**plan.standing, OCCLUDER: footprint})
                if shift is not None:
                    moves = _moves((near[0], *plan.riders(near[0])), *shift)
                    return (*moves, _put_occluder(plan, carrier, footprint))
    raise ManifestError(f"{task.name}: there is no room for an occluder in front of {target}.")


def _in_front(plan: Floorplan, carrier: str) -> Iterator[Footprint]:
    """Places for the occluder: before the front of a fixture, or so far from the middle of an object."""
    low_x, high_x, low_y, high_y = extent(OCCLUDER_CATEGORY)
    x, y = plan.centre(carrier)
    if category(category_of(carrier)).fixture:
        x = max(corner[0] for corner in plan.standing[carrier].corners()) - _FRONT_M[0][0] / 2
    for dx, dy in _FRONT_M:
        yield Footprint(round(x + dx, 6), round(y + dy, 6), (high_x - low_x) / 2, (high_y - low_y) / 2)


def _put_occluder(plan: Floorplan, carrier: str, footprint: Footprint) -> Json:
    """Place the occluder next to an object as that is in each initial state, or before a fixture."""
    if category(category_of(carrier)).fixture:
        return PutObject(OCCLUDER, plan.arena.surface, (footprint.x, footprint.y)).to_dict()
    x, y = plan.centre(carrier)
    offset = round(footprint.x - x, 6), round(footprint.y - y, 6)
    return PutObject(OCCLUDER, plan.arena.surface, offset, carrier).to_dict()


def _away(plan: Floorplan, name: str, now: Mapping[str, Footprint]) -> tuple[float, float] | None:
    """Return the least shift by which an object gets out of the way, within reach; None if there is none."""
    x, y = plan.centre(name)
    for must_be_seen in (True, False):
        for length in (percent / 100 for percent in range(6, 34, 2)):
            for angle in _ANGLES_DEG:
                dx = round(length * math.cos(math.radians(angle)), 6)
                dy = round(length * math.sin(math.radians(angle)), 6)
                footprint = plan.standing[name].moved(dx, dy)
                seen = plan.in_view(footprint) if must_be_seen else plan.inside(footprint)
                if seen and plan.reachable(x + dx, y + dy) and _clear(footprint, now, {name}):
                    return dx, dy
    return None
