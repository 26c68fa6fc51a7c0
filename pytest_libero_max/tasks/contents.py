"""Contents of a task's scene, as far as the choice of an event depends on them.

Everything is derived from the task description: typed objects and fixtures, the objects of interest, the
goal and the declared placements. No simulator is involved.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from pytest_libero_max.benchmark.cases import TRIGGER_DISTANCE_M
from pytest_libero_max.tasks import libero_tasks as tasks
from pytest_libero_max.worlds.robot import CAMERAS


@dataclass(frozen=True)
class Relation:
    """One predicate of a goal, for example ``On(akita_black_bowl_1, plate_1)``."""

    predicate: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class InitialPlacement:
    """Place that the task description gives an object at the start."""

    predicate: str
    """``On`` or ``In``."""
    region: str
    """The region or entity named."""
    support: str | None
    """The entity the region belongs to, or None."""


@dataclass(frozen=True)
class Room:
    """Rectangle of the plane in which the positions of a thing may be, m, world frame."""

    low: tuple[float, float]
    """Smallest x and y."""
    high: tuple[float, float]
    """Largest x and y."""

    def holds(self, x: float, y: float) -> bool:
        """Return True if a position lies in it."""
        return self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]

    def share(self, x: float, y: float) -> float:
        """Return the share of its positions that are still in it after a movement by x and y."""
        sides = (high - low for low, high in zip(self.low, self.high, strict=True))
        return math.prod(
            max(0.0, 1.0 - abs(move) / side) if side > 0.0 else float(move == 0.0)
            for move, side in zip((x, y), sides, strict=True)
        )


@dataclass(frozen=True)
class TaskMetadata:
    """The facts about one task that construction decides by."""

    name: str
    """File stem of the task description."""
    language: str
    objects: Mapping[str, str]
    """Movable instances with their category."""
    fixtures: Mapping[str, str]
    """Fixed instances with their category; tables and floors are among them."""
    objects_of_interest: frozenset[str]
    """Names the task description marks (may be regions)."""
    goal: tuple[Relation, ...]
    """The goal's predicates, in order; all must hold."""
    placements: Mapping[str, InitialPlacement]
    """Initial placement of the movable objects that have one."""
    reserved: frozenset[str] = field(default_factory=frozenset)
    """Objects that a source variation added and that no event may use."""
    parked: frozenset[str] = field(default_factory=frozenset)
    """Objects that are out of the scene at reset until an event brings them in."""
    camera: str = CAMERAS[0]
    """The main camera of its robot, which a shift of the viewpoint moves."""
    other_cameras: tuple[str, ...] = CAMERAS[1:]
    """The other cameras of its robot."""
    part: str | None = None
    """Part of the target that the hand has to come near, an entity of its own; None for the target itself."""
    trigger_distance_m: float = TRIGGER_DISTANCE_M
    """Distance from the hand to the trigger entity at which events happen."""
    rooms: Mapping[str, Room] = field(default_factory=dict)
    """Places to which an event may move a thing, by its name; anywhere within reach for others."""
    impossible: Mapping[str, str] = field(default_factory=dict)
    """Events that the task cannot host for a reason of its own, with that reason."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """The cameras of its robot, the main one first."""
        return (self.camera, *self.other_cameras)

    @property
    def goal_entities(self) -> tuple[str, ...]:
        """Entities the goal's arguments name, in first-seen order."""
        named = (self.entity_of(argument) for relation in self.goal for argument in relation.arguments)
        return tuple(dict.fromkeys(entity for entity in named if entity is not None))

    @property
    def primary_target(self) -> str | None:
        """The first movable object that is the first argument of a goal predicate."""
        return next(
            (r.arguments[0] for r in self.goal if r.arguments and r.arguments[0] in self.objects), None
        )

    @property
    def trigger_entity(self) -> str | None:
        """The entity that an event's trigger watches: the target, or the first that the goal names."""
        return self.part or self.primary_target or next(iter(self.goal_entities), None)

    @property
    def primary_receptacle(self) -> str | None:
        """Entity that the primary target has to go to: an object, a fixture or a table."""
        for relation in self.goal:
            if len(relation.arguments) >= 2 and relation.arguments[0] == self.primary_target:
                receptacle = self.entity_of(relation.arguments[1])
                if receptacle is not None:
                    return receptacle
        return None

    @property
    def distractors(self) -> tuple[str, ...]:
        """Objects that neither the goal nor the task description names, sorted."""
        cared_for = set(self.goal_entities) | self.objects_of_interest | self.reserved
        return tuple(sorted(set(self.objects) - cared_for))

    @property
    def supported_distractors(self) -> tuple[str, ...]:
        """The distractors with a declared support, sorted."""
        return tuple(name for name in self.distractors if self.support(name) is not None)

    @property
    def obstacle_candidates(self) -> tuple[str, ...]:
        """The distractors on the support of the trigger entity, or of what it is a part of, sorted."""
        carried = self.trigger_entity if self.part is None else self.primary_target
        support = None if carried is None else self.support(carried)
        if support is None:
            return ()
        return tuple(name for name in self.supported_distractors if self.support(name) == support)

    def support(self, entity: str) -> str | None:
        """Return the entity that ``entity`` is declared to rest on or in at the start, or None."""
        placement = self.placements.get(entity)
        return None if placement is None else placement.support

    def planar(self, entity: str | None) -> bool:
        """Return True if it is a movable object placed ``On`` a table or a floor, where it can be shifted."""
        if entity is None or entity not in self.objects:
            return False
        placement = self.placements.get(entity)
        if placement is None or placement.predicate.lower() != "on" or placement.support is None:
            return False
        surface = self.fixtures.get(placement.support, "")
        return surface == "floor" or "table" in surface

    def entity_of(self, argument: str) -> str | None:
        """Return the entity a name belongs to: itself, or the longest entity name it continues with ``_``."""
        return owner(argument, [*self.objects, *self.fixtures])


def owner(name: str, entities: Iterable[str]) -> str | None:
    """Return the longest of ``entities`` that is ``name`` or that ``name`` continues with an underscore."""
    owners = [entity for entity in entities if name == entity or name.startswith(f"{entity}_")]
    return max(owners, key=len, default=None)


def task_metadata(suite: str, index: int) -> TaskMetadata:
    """Contents of an unmodified LIBERO task, from the table of tasks, or raise SubstrateError.

    The objects of interest are the goal's entities, as LIBERO marks them in these suites.
    """
    row = tasks.task(suite, index)
    objects = {name: tasks.category_of(name) for name in row.objects}
    fixtures = {name: tasks.category_of(name) for name in row.fixtures}
    fixtures |= {place.surface: place.surface.removeprefix("main_") for place in row.places.values()}
    placements = {}
    for fact in row.start:
        if fact.subject in objects and fact.predicate in ("on", "in") and fact.place is not None:
            support = owner(fact.place, [*objects, *fixtures])
            placements[fact.subject] = InitialPlacement(fact.predicate.capitalize(), fact.place, support)
    goal = tuple(
        Relation(fact.predicate.capitalize(), tuple(a for a in (fact.subject, fact.place) if a is not None))
        for fact in row.goal
    )
    named = (owner(argument, [*objects, *fixtures]) for relation in goal for argument in relation.arguments)
    return TaskMetadata(
        name=row.name,
        language=row.language,
        objects=objects,
        fixtures=fixtures,
        objects_of_interest=frozenset(name for name in named if name is not None),
        goal=goal,
        placements=placements,
    )
