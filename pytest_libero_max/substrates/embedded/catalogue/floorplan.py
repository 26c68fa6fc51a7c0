"""Floor plan of each task: positions of everything on the table or floor, and the free space.

Computed from the task tables and the designs of the objects, without a simulator. Each thing is a rectangle
or a disc, wide enough for every initial state.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pytest_libero_max.substrates.embedded.arenas import ARENAS, Arena
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.objects.parts import Link
from pytest_libero_max.tasks.contents import owner
from pytest_libero_max.tasks.libero_tasks import Task, category_of
from pytest_libero_max.tasks.libero_tasks import task as task_of
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array

MIN_REACH_M, MAX_REACH_M = 0.38, 0.78
"""Smallest and largest horizontal distance of objects to handle from the robot's base."""

_AREA = (-0.45, 0.36, -0.45, 0.45)
"""Range of x and y in which objects are put, m, world."""

_EDGE_M = 0.06

_ROUND = frozenset(
    {
        "akita_black_bowl",
        "alphabet_soup",
        "glazed_rim_porcelain_ramekin",
        "plate",
        "tomato_sauce",
        "wine_bottle",
    }
)

# Half the width of agentview's picture at unit distance, less a margin.
_HALF_VIEW = 0.94 * math.tan(math.radians(22.5))


@dataclass(frozen=True)
class Footprint:
    """A rectangle or a disc on the table or floor."""

    x: float
    y: float
    """Middle, m, world."""
    half_x: float
    """Half its side along its own x axis, m."""
    half_y: float
    """Half its side along its own y axis, m."""
    yaw: float = 0.0
    """Turn about the vertical, rad."""
    slack: float = 0.0
    """Largest deviation in an initial state, m."""
    round: bool = False
    """True if it is the disc that fits into the rectangle."""

    def moved(self, dx: float, dy: float) -> Footprint:
        return replace(self, x=self.x + dx, y=self.y + dy)

    def gap(self, other: Footprint) -> float:
        """Least distance between the two minus the slack of both, m; negative where they overlap.

        Between rectangles that are corner to corner it is a little less than that.
        """
        if self.round or other.round:
            disc, body = (self, other) if self.round else (other, self)
            radius = disc.half_x + (body.half_x if body.round else 0.0)
            apart = _distance(body, disc.x, disc.y) - radius
        else:
            apart = max(_separation(self, other), _separation(other, self))
        return apart - self.slack - other.slack

    def corners(self) -> list[tuple[float, float]]:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
        return [
            (
                self.x + c * a * self.half_x - s * b * self.half_y,
                self.y + s * a * self.half_x + c * b * self.half_y,
            )
            for a, b in signs
        ]


def _distance(body: Footprint, x: float, y: float) -> float:
    """From a point to the middle of a disc, or to the edge of a rectangle, negative within it."""
    dx, dy = x - body.x, y - body.y
    if body.round:
        return math.hypot(dx, dy)
    c, s = math.cos(body.yaw), math.sin(body.yaw)
    u, v = abs(c * dx + s * dy) - body.half_x, abs(c * dy - s * dx) - body.half_y
    return math.hypot(max(u, 0.0), max(v, 0.0)) if max(u, v) > 0.0 else max(u, v)


def _separation(one: Footprint, other: Footprint) -> float:
    """Distance along whichever of the axes of ``one`` separates the two best."""
    c, s = math.cos(one.yaw), math.sin(one.yaw)
    best = -math.inf
    for (ax, ay), half in (((c, s), one.half_x), ((-s, c), one.half_y)):
        along = [(x - one.x) * ax + (y - one.y) * ay for x, y in other.corners()]
        best = max(best, min(along) - half, -half - max(along))
    return best


@cache
def extent(name: str, opened: frozenset[str] = frozenset()) -> tuple[float, float, float, float]:
    """Range of x and y of a category as it stands, m, relative to its origin.

    Args:
        opened: Regions whose drawers are open; an empty name opens whatever the category can open.
    """
    points = np.concatenate(list(_points(category(name).root, np.zeros(3), np.eye(3), opened)))
    low, high = points.min(axis=0), points.max(axis=0)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _points(link: Link, origin: Array, turn: Array, opened: frozenset[str]) -> Iterator[Array]:
    """Corners of everything that collides, with open drawers and doors at the lower end of their range."""
    at = origin + turn @ np.asarray(link.pos)
    if link.joint is not None and ("" in opened or any(site.name in opened for site in link.sites)):
        axis, end = link.joint.axis, link.joint.range[0]
        if link.joint.kind == "slide":
            at = at + turn @ np.asarray(axis) * end
        else:
            turn = turn @ rotations.matrix(rotations.about(axis, end))
    signs = np.array([(a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1)], dtype=np.float64)
    for solid in link.solids:
        corners = (signs * np.asarray(solid.half)) @ rotations.matrix(solid.quat).T + np.asarray(solid.pos)
        yield at + corners @ turn.T
    for child in link.links:
        yield from _points(child, at, turn, opened)


def footprint_at(name: str, x: float, y: float, yaw: float = 0.0, slack: float = 0.0) -> Footprint:
    """Return the footprint of a category whose origin is at (x, y)."""
    return _placed(extent(name), x, y, yaw, slack, name in _ROUND)


def _placed(
    span: tuple[float, float, float, float], x: float, y: float, yaw: float, slack: float, disc: bool
) -> Footprint:
    low_x, high_x, low_y, high_y = span
    c, s = math.cos(yaw), math.sin(yaw)
    mid_x, mid_y = (low_x + high_x) / 2, (low_y + high_y) / 2
    return Footprint(
        x + c * mid_x - s * mid_y,
        y + s * mid_x + c * mid_y,
        (high_x - low_x) / 2,
        (high_y - low_y) / 2,
        yaw,
        slack,
        disc,
    )


@dataclass(frozen=True)
class Floorplan:
    """A task's table or floor."""

    task: Task
    arena: Arena
    standing: Mapping[str, Footprint]
    """Footprints on the surface itself, by instance."""
    carried: Mapping[str, str]
    """Carriers of what rests on or in something else, by instance."""

    def riders(self, name: str) -> tuple[str, ...]:
        """Instances that rest on or in an instance, directly or not."""
        above = [rider for rider, carrier in self.carried.items() if carrier == name]
        return tuple(rider for direct in above for rider in (direct, *self.riders(direct)))

    def carrier(self, name: str) -> str:
        """Instance that stands on the surface for an instance: itself, or its last carrier."""
        return self.carrier(self.carried[name]) if name in self.carried else name

    def centre(self, name: str) -> tuple[float, float]:
        """Position of an instance's origin, or of its carrier's, m, world."""
        return start_of(self.task, self.carrier(name))

    def gap(self, footprint: Footprint, ignoring: Iterable[str] = ()) -> float:
        """Least distance from everything that stands there, m."""
        left_out = set(ignoring)
        gaps = [footprint.gap(other) for name, other in self.standing.items() if name not in left_out]
        return min(gaps, default=math.inf)

    def inside(self, footprint: Footprint) -> bool:
        """Return True if all of it is on the surface and in view."""
        low_x, high_x, low_y, high_y = _AREA
        if self.arena.solids:
            top = max(self.arena.solids, key=lambda solid: solid.half[0] * solid.half[1])
            x, y = (self.arena.surface_pos[axis] + top.pos[axis] for axis in (0, 1))
            low_x, high_x = max(low_x, x - top.half[0] + _EDGE_M), min(high_x, x + top.half[0] - _EDGE_M)
            low_y, high_y = max(low_y, y - top.half[1] + _EDGE_M), min(high_y, y + top.half[1] - _EDGE_M)
        return all(low_x <= x <= high_x and low_y <= y <= high_y for x, y in footprint.corners())

    def in_view(self, footprint: Footprint) -> bool:
        """Return True if ``agentview`` sees all of it."""
        place, turn = (np.array(part) for part in self.arena.agentview)
        axes = rotations.matrix((turn[0], turn[1], turn[2], turn[3]))
        for x, y in footprint.corners():
            right, up, back = axes.T @ (np.array([x, y, self.arena.top_z]) - place)
            if back >= 0 or max(abs(right), abs(up)) > -back * _HALF_VIEW:
                return False
        return True

    def reachable(self, x: float, y: float) -> bool:
        """Return True if the robot gets there with its tool pointing down."""
        base = self.arena.robot_base_pos
        return MIN_REACH_M <= math.hypot(x - base[0], y - base[1]) <= MAX_REACH_M


@cache
def floorplan(suite: str, index: int) -> Floorplan:
    """Floor plan of a task, or raise SubstrateError."""
    task = task_of(suite, index)
    opened: dict[str, set[str]] = {}
    for fact in task.start:
        if fact.predicate == "open":
            instance = owner_of(task, fact.subject)
            opened.setdefault(instance, set()).add(fact.subject.removeprefix(instance).removeprefix("_"))
    standing, carried = {}, {}
    for fact in task.start:
        if fact.place is None:
            continue
        if fact.place in task.places:
            place = task.places[fact.place]
            kind = category(category_of(fact.subject))
            x, y = start_of(task, fact.subject)
            half = (place.box[2] - place.box[0]) / 2
            slack = 0.0 if kind.fixture else abs(half - kind.spread_margin)
            span = extent(category_of(fact.subject), frozenset(opened.get(fact.subject, ())))
            if kind.turn is not None and not kind.fixture:
                # It starts at any angle, so it takes all the room that it takes at one of them.
                reach = max(math.hypot(a, b) for a in span[:2] for b in span[2:])
                standing[fact.subject] = Footprint(x, y, reach, reach, slack=slack, round=True)
                continue
            disc = category_of(fact.subject) in _ROUND
            standing[fact.subject] = _placed(span, x, y, place.yaw, slack, disc)
        else:
            carried[fact.subject] = owner_of(task, fact.place)
    return Floorplan(task, ARENAS[task.arena], standing, carried)


def spot_of(task: Task, name: str) -> tuple[float, float]:
    """Middle of an instance at the start, on whatever it rests, m, world."""
    plan = floorplan(task.suite, task.index)
    if name not in plan.carried:
        return start_of(task, name)
    carrier = plan.carried[name]
    x, y = spot_of(task, carrier)
    region = next(fact.place or "" for fact in task.start if fact.subject == name and fact.place)
    if region == carrier:
        return x, y
    offset = _site(category(category_of(carrier)).root, np.zeros(3), region.removeprefix(f"{carrier}_"))
    put = next(fact.place for fact in task.start if fact.subject == carrier and fact.place in task.places)
    yaw = task.places[put or ""].yaw
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * offset[0] - s * offset[1], y + s * offset[0] + c * offset[1]


def _site(link: Link, origin: Array, name: str) -> Array:
    """Pose of a region in the frame of its instance, with every drawer shut."""
    at = origin + np.asarray(link.pos)
    for site in link.sites:
        if site.name == name:
            position: Array = at + np.asarray(site.pos)
            return position
    inside = [_site(child, at, name) for child in link.links]
    return next((place for place in inside if place.size), np.empty(0))


def owner_of(task: Task, name: str) -> str:
    """Return the instance that a region belongs to; an instance belongs to itself."""
    return owner(name, (*task.objects, *task.fixtures)) or name


def start_of(task: Task, name: str) -> tuple[float, float]:
    """Return the middle of the place in which an instance starts, m, world."""
    put = next(fact.place for fact in task.start if fact.subject == name and fact.place in task.places)
    place = task.places[put or ""]
    x0, y0, x1, y1 = place.box
    return (x0 + x1) / 2, (y0 + y1) / 2
