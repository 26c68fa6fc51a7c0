"""Changes of poses: objects are moved, turned, put down, taken out of the scene, brought back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from pytest_libero_max.benchmark.structs import Count, Text
from pytest_libero_max.changes.alteration import Alteration
from pytest_libero_max.changes.factors import Factor, measure_poses
from pytest_libero_max.changes.fields import (
    FARTHEST_M,
    Cosine,
    Degrees,
    ManifestFields,
    Offset,
    Place,
    between,
)
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.errors import ChangeError, EntityError, counted, did_you_mean
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import AlterableWorld, Array

_FAR_ABOVE_M = 1.0
_STEP_M, _BISECTIONS, _MAX_STEPS = 0.004, 12, 500

_Speed = Annotated[float, between(-10.0, 10.0)]


class _PoseChange(Alteration):
    object: Text

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset(f"pose:{name}" for name in self._names())

    def _names(self) -> list[str]:
        return [self.object]

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        return measure_poses(world, self._names())

    def _in_order(self) -> list[Factor]:
        return [f"pose:{name}" for name in self._names()]


@dataclass(frozen=True)
class MoveObject(_PoseChange):
    """Move an object or a fixture, keeping its orientation; it is at rest afterwards.

    A move by nothing leaves the world bit-identical: it does not even stop a moving object.
    """

    operation: ClassVar[str] = "move_object"
    magnitudes = ("delta_position_m", "distance_m")

    object: Text
    delta_position_m: Place
    """Added to its position, world frame."""
    support_entity: Text | None = None
    """Its support before and after; a note."""
    distance_m: Annotated[float, between(0.0, 2 * FARTHEST_M)] | None = None
    """Length of the move; a note."""
    direction_xy: tuple[Cosine, Cosine] | None = None
    """Direction of the move, unit vector; a note."""
    calibration: Text | None = None
    """Rule by which the direction was chosen; a note."""

    def _require(self, world: AlterableWorld) -> None:
        _require_movable(world, self.operation, self.object)

    def _alter(self, world: AlterableWorld) -> None:
        if any(self.delta_position_m):
            world.place(self.object, world.position(self.object) + self.delta_position_m)


@dataclass(frozen=True)
class BumpObject(_PoseChange):
    """Give an object a velocity at once, also in the hand, whose grip then stops it within millimetres."""

    operation: ClassVar[str] = "bump_object"
    magnitudes = ("velocity_m_s",)
    final: ClassVar[str] = "the object has moved."

    object: Text
    velocity_m_s: tuple[_Speed, _Speed, _Speed]
    """Added to its linear velocity, world frame."""

    def _require(self, world: AlterableWorld) -> None:
        require_in_scene(world, self.operation, "object", self.object)
        _require_object(world, self.operation, self.object)

    def _alter(self, world: AlterableWorld) -> None:
        if any(self.velocity_m_s):
            world.push(self.object, self.velocity_m_s)

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        return {
            **super()._measure(world),
            "velocity_m_s": world.velocity(self.object).tolist(),
            "fingers": world.fingers_on(self.object),
        }


@dataclass(frozen=True)
class RemoveObject(Indivisible, _PoseChange):
    """Take an object out of the scene: unseen, untouchable and unmoved until it is inserted again."""

    operation: ClassVar[str] = "remove_object"

    object: Text
    """The object to take out."""
    offworld_position_m: Place
    """Position at which it is kept meanwhile, world frame."""

    def _require(self, world: AlterableWorld) -> None:
        require_in_scene(world, self.operation, "object", self.object)
        _require_object(world, self.operation, self.object)

    def _alter(self, world: AlterableWorld) -> None:
        world.park(self.object, self.offworld_position_m)


@dataclass(frozen=True)
class Placement(ManifestFields):
    """Place at which an object that was taken out comes back."""

    operation: ClassVar[str] = "placement"

    object: Text
    relative_to: Text
    """The anchor: an entity whose position at that moment is the origin of the offset."""
    offset_m: Place
    """From the anchor to the object, world frame."""
    preserve_initial_z: bool
    """Keep the height the object had when it was taken out, whatever the offset's z."""
    support_entity: Text | None = None
    """Its support then; a note."""
    placement_rule: Text | None = None
    """Rule by which the offset was chosen; a note."""


class _Insertion(_PoseChange):
    """Objects come back at their places, each in the orientation it had when it was taken out."""

    def _places(self) -> Sequence[Placement]:
        raise NotImplementedError

    def _names(self) -> list[str]:
        return [place.object for place in self._places()]

    def _require(self, world: AlterableWorld) -> None:
        for place in self._places():
            _require_known(world, place.object)
            require_in_scene(world, self.operation, "relative_to", place.relative_to)
            if place.object not in world.parked:
                raise ChangeError.seen(
                    f"{self.operation}.object",
                    place.object,
                    " is in the scene already and cannot be brought back."
                    " Take it out in the event's setup (remove_object), and insert it once.",
                )

    def _alter(self, world: AlterableWorld) -> None:
        # All targets are computed before anything moves, and nothing moves unless everything can.
        targets = []
        for place in self._places():
            position = world.position(place.relative_to) + place.offset_m
            if place.preserve_initial_z:
                position[2] = world.parked_pose(place.object)[0][2]
            targets.append(position)
        for name, target in zip(self._names(), targets, strict=True):
            world.unpark(name, target)


@dataclass(frozen=True)
class InsertObstacle(Indivisible, _Insertion, Placement):
    """Bring one object back, next to an anchor, in the orientation it had when it was taken out.

    Fields as in :class:`Placement`.
    """

    operation: ClassVar[str] = "insert_obstacle"

    def _places(self) -> Sequence[Placement]:
        return [self]


@dataclass(frozen=True)
class InsertDistractors(Indivisible, _Insertion):
    """Bring several objects back at once, each in the orientation it had when it was taken out."""

    operation: ClassVar[str] = "insert_distractors"

    placements: tuple[Placement, ...]
    """Place at which each of them comes back; every object once."""
    distractor_count: Count

    def __post_init__(self) -> None:
        where = "insert_distractors"
        if not isinstance(self.placements, list | tuple) or not self.placements:
            raise ChangeError.seen(f"{where}.placements", self.placements, ", but must be a non-empty list.")
        placements = tuple(_placement(f"{where}.placements[{i}]", v) for i, v in enumerate(self.placements))
        self._set("placements", placements)
        names = [placement.object for placement in placements]
        if len(set(names)) < len(names):
            raise ChangeError(f"{where}.placements name {names!r}, but every object may come back only once.")
        super().__post_init__()
        if self.distractor_count != len(placements):
            raise ChangeError.seen(
                f"{where}.distractor_count",
                self.distractor_count,
                f", but there are {counted(len(placements), 'placement')}. Make them equal.",
            )

    def _places(self) -> Sequence[Placement]:
        return self.placements


@dataclass(frozen=True)
class PutObject(Indivisible, _PoseChange):
    """Put an object down on something, a hair above touching it; one that was taken out comes back for it."""

    operation: ClassVar[str] = "put_object"

    object: Text
    """The object to move."""
    onto: Text
    """The entity it is to rest on: a table, a floor, a fixture or another object."""
    offset_xy_m: tuple[Offset, Offset]
    """From there to the object, world frame."""
    relative_to: Text | None = None
    """The entity whose position is the origin of the offset; None for the world's origin."""
    yaw_degrees: Degrees = 0.0
    """Turn about the vertical from the orientation it has, or had when it was taken out."""

    def _require(self, world: AlterableWorld) -> None:
        _require_known(world, self.object)
        _require_object(world, self.operation, self.object)
        require_in_scene(world, self.operation, "onto", self.onto)
        if self.relative_to is not None:
            require_in_scene(world, self.operation, "relative_to", self.relative_to)

    def _alter(self, world: AlterableWorld) -> None:
        x, y = self.offset_xy_m
        if self.relative_to is not None:
            anchor = world.position(self.relative_to)
            x, y = float(anchor[0]) + x, float(anchor[1]) + y
        above = world.top_m(self.onto)
        if above is None:
            raise ChangeError.seen("put_object.onto", self.onto, " has nothing that could carry anything.")
        if self.object in world.parked:
            world.unpark(self.object, (x, y, above + _FAR_ABOVE_M))  # its size is not known before
        start = np.array([x, y, above + world.radius_m(self.object)])
        turn = world.pose(self.object)[1]
        world.place(self.object, start, _yawed(turn, self.yaw_degrees) if self.yaw_degrees else None)
        _lower(world, self.object, self.onto, start)


@dataclass(frozen=True)
class TurnObject(_PoseChange):
    """Turn an object or a fixture about the vertical through its origin; it is at rest afterwards."""

    operation: ClassVar[str] = "turn_object"
    magnitudes = ("yaw_degrees",)

    object: Text
    yaw_degrees: Degrees
    """Counter-clockwise seen from above."""

    def _require(self, world: AlterableWorld) -> None:
        _require_movable(world, self.operation, self.object)

    def _alter(self, world: AlterableWorld) -> None:
        if self.yaw_degrees:
            position, turn = world.pose(self.object)
            world.place(self.object, position, _yawed(turn, self.yaw_degrees))


def _lower(world: AlterableWorld, name: str, onto: str, start: Array) -> None:
    """Lower an object until it would touch ``onto``, and leave it a few micrometres above that height."""
    at = start.copy()

    def meets(height: float) -> bool:
        at[2] = height
        world.place(name, at)
        return onto in world.contacts(name)

    free = float(start[2])
    for _ in range(_MAX_STEPS):
        if meets(free - _STEP_M):
            break
        free -= _STEP_M
    else:
        raise ChangeError(
            f"put_object: {name!r} does not meet {onto!r} at ({start[0]:.3f}, {start[1]:.3f}). "
            "Choose a place above it."
        )
    blocked = free - _STEP_M
    for _ in range(_BISECTIONS):
        middle = (free + blocked) / 2
        free, blocked = (free, middle) if meets(middle) else (middle, blocked)
    meets(free)  # the last height that was tried may be one at which they touch


def _placement(where: str, value: Any) -> Placement:
    if isinstance(value, Placement):
        return value
    if not isinstance(value, dict):
        raise ChangeError.seen(where, value, ", but must be an object that describes a placement.")
    if "operation" in value:
        raise ChangeError(f"{where} has the unknown field 'operation'; a placement is not a change.")
    try:
        return Placement.from_dict(value)
    except ChangeError as error:
        raise error.within(where) from error


def _require_known(world: AlterableWorld, entity: str) -> None:
    if entity not in world.entities:
        raise EntityError.seen(
            "entity", entity, f" is not in the scene. {did_you_mean(entity, world.entities)}"
        )


def require_in_scene(world: AlterableWorld, operation: str, field: str, entity: str) -> None:
    """Check that ``entity`` exists and has not been taken out."""
    _require_known(world, entity)
    if entity in world.parked:
        raise ChangeError.seen(
            f"{operation}.{field}",
            entity,
            " has been taken out of the scene. Insert it first, or name an entity that is there.",
        )


def _require_object(world: AlterableWorld, operation: str, entity: str) -> None:
    kind = world.entities[entity].kind
    if kind != "object":
        known = [name for name, other in world.entities.items() if other.kind == "object"]
        raise ChangeError.seen(
            f"{operation}.object",
            entity,
            f" is a {kind}, but must be an object. {did_you_mean(entity, known)}",
        )


def _require_movable(world: AlterableWorld, operation: str, entity: str) -> None:
    require_in_scene(world, operation, "object", entity)
    if world.entities[entity].kind == "surface":
        raise ChangeError.seen(
            f"{operation}.object",
            entity,
            " is the surface that others stand on and cannot be moved. Name an object or a fixture.",
        )


def _yawed(turn: Array, yaw_degrees: float) -> rotations.Quaternion:
    return rotations.unit_by_hypot(rotations.yawed(rotations.quaternion(turn), yaw_degrees))
