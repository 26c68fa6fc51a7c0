"""Changes of poses: objects are moved, turned, put down, taken out of the scene, brought back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from pytest_libero_max.benchmark.structs import Count, Text
from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import (
    FARTHEST_M,
    Cosine,
    Degrees,
    ManifestFields,
    Offset,
    Place,
    between,
    strength_of,
)
from pytest_libero_max.changes.lowering import lower, reach, top
from pytest_libero_max.changes.measuring import measure_poses
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.changes.reversal import Reversal, former_poses, saved
from pytest_libero_max.errors import ChangeError, EntityError, counted, did_you_mean
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import AlterableWorld, Array

_FAR_ABOVE_M = 1.0

_Speed = Annotated[float, between(-10.0, 10.0)]


@dataclass(frozen=True)
class MoveObject(ManifestFields):
    """Move an object or a fixture, keeping its orientation; it is at rest afterwards.

    A move by nothing leaves the world bit-identical: it does not even stop a moving object.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "move_object"

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

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        require_in_scene(world, self.operation, "object", self.object)
        if world.entities[self.object].kind == "surface":
            raise ChangeError.seen(
                "move_object.object",
                self.object,
                " is the surface that others stand on and cannot be moved. Name an object or a fixture.",
            )
        before = measure_poses(world, [self.object])
        if any(self.delta_position_m):
            world.place(self.object, world.position(self.object) + self.delta_position_m)
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, measure_poses(world, [self.object])
        )

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)

    def scaled(self, strength: float) -> MoveObject:
        """Return the move with its length multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        if s == 1.0:
            return self
        x, y, z = self.delta_position_m
        distance = None if self.distance_m is None else self.distance_m * s
        return replace(self, delta_position_m=(x * s, y * s, z * s), distance_m=distance)


@dataclass(frozen=True)
class BumpObject(ManifestFields):
    """Give an object a velocity at once, also in the hand, whose grip then stops it within millimetres.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "bump_object"

    object: Text
    velocity_m_s: tuple[_Speed, _Speed, _Speed]
    """Added to its linear velocity, world frame."""

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        require_in_scene(world, self.operation, "object", self.object)
        if world.entities[self.object].kind != "object":
            raise ChangeError.seen(
                "bump_object.object", self.object, f" is none. {did_you_mean(self.object, _objects(world))}"
            )
        before = self._measure(world)
        if any(self.velocity_m_s):
            world.push(self.object, self.velocity_m_s)
        return Evidence(self.operation, tuple(self.factors), before, self._measure(world))

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        first = world.model.body(world.entities[self.object].body).dofadr[0]
        return {
            **measure_poses(world, [self.object]),
            "velocity_m_s": world.data.qvel[first : first + 3].tolist(),
            "fingers": world.fingers_on(self.object),
        }

    def reverted(self, evidence: Evidence) -> Reversal:
        """Refuse: the object has moved since.

        Raises:
            ChangeError: Always.
        """
        raise ChangeError(f"{self.operation} cannot be taken back: the object has moved. Leave it out.")

    def scaled(self, strength: float) -> BumpObject:
        """Return the change with its velocity multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        x, y, z = self.velocity_m_s
        return replace(self, velocity_m_s=(x * s, y * s, z * s))


@dataclass(frozen=True)
class RemoveObject(Indivisible):
    """Take an object out of the scene: unseen, untouchable and unmoved until it is inserted again.

    All or nothing: it cannot be scaled to anything between.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "remove_object"

    object: Text
    """The object to take out."""
    offworld_position_m: Place
    """Position at which it is kept meanwhile, world frame."""

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        require_in_scene(world, self.operation, "object", self.object)
        kind = world.entities[self.object].kind
        if kind != "object":
            raise ChangeError.seen(
                "remove_object.object",
                self.object,
                f" is a {kind}, but only objects can be taken out. "
                f"{did_you_mean(self.object, _objects(world))}",
            )
        before = measure_poses(world, [self.object])
        world.park(self.object, self.offworld_position_m)
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, measure_poses(world, [self.object])
        )

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)


@dataclass(frozen=True)
class Placement(ManifestFields):
    """Place at which an object that was taken out comes back.

    Raises:
        ChangeError: A value breaks its rule.
    """

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


@dataclass(frozen=True)
class InsertObstacle(Indivisible, Placement):
    """Bring one object back, next to an anchor, in the orientation it had when it was taken out.

    All or nothing: it cannot be scaled to anything between. Fields as in :class:`Placement`.
    """

    operation: ClassVar[str] = "insert_obstacle"

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        return _insert(world, self.operation, [self])

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)


@dataclass(frozen=True)
class InsertDistractors(Indivisible):
    """Bring several objects back at once, each in the orientation it had when it was taken out.

    All or nothing: it cannot be scaled to anything between.

    Raises:
        ChangeError: A value breaks its rule.
    """

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

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors(placement.object for placement in self.placements)

    def apply(self, world: AlterableWorld) -> Evidence:
        return _insert(world, self.operation, self.placements)

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)


@dataclass(frozen=True)
class PutObject(Indivisible):
    """Put an object down on something, a hair above touching it; one that was taken out comes back for it.

    All or nothing: it cannot be scaled to anything between.

    Raises:
        ChangeError: A value breaks its rule.
    """

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

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        if self.object not in world.entities:
            raise EntityError.seen(
                "entity", self.object, f" is not in the scene. {did_you_mean(self.object, world.entities)}"
            )
        kind = world.entities[self.object].kind
        if kind != "object":
            raise ChangeError.seen(
                "put_object.object", self.object, f" is a {kind}, but only objects can be put."
            )
        require_in_scene(world, self.operation, "onto", self.onto)
        before, former = measure_poses(world, [self.object]), _parked_poses(world, [self.object])
        x, y = self.offset_xy_m
        if self.relative_to is not None:
            require_in_scene(world, self.operation, "relative_to", self.relative_to)
            anchor = world.position(self.relative_to)
            x, y = float(anchor[0]) + x, float(anchor[1]) + y
        above = top(world, self.onto)
        if self.object in world.parked:
            world.unpark(self.object, (x, y, above + _FAR_ABOVE_M))  # its size is not known before
        start = np.array([x, y, above + reach(world, self.object)])
        turn = world.pose(self.object)[1]
        world.place(self.object, start, _yawed(turn, self.yaw_degrees) if self.yaw_degrees else None)
        lower(world, self.object, self.onto, start)
        after = measure_poses(world, [self.object])
        return Evidence(self.operation, tuple(sorted(self.factors)), before, after, {"parked": former})

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)


@dataclass(frozen=True)
class TurnObject(ManifestFields):
    """Turn an object or a fixture about the vertical through its origin; it is at rest afterwards.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "turn_object"

    object: Text
    yaw_degrees: Degrees
    """Counter-clockwise seen from above."""

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: AlterableWorld) -> Evidence:
        require_in_scene(world, self.operation, "object", self.object)
        if world.entities[self.object].kind == "surface":
            raise ChangeError.seen(
                "turn_object.object",
                self.object,
                " is the surface that others stand on. Name an object or a fixture.",
            )
        before = measure_poses(world, [self.object])
        if self.yaw_degrees:
            position, turn = world.pose(self.object)
            world.place(self.object, position, _yawed(turn, self.yaw_degrees))
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, measure_poses(world, [self.object])
        )

    def reverted(self, evidence: Evidence) -> Reversal:
        return _pose_reversal(self, evidence)

    def scaled(self, strength: float) -> TurnObject:
        """Return the angle multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, yaw_degrees=self.yaw_degrees * s)


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


def _insert(world: AlterableWorld, operation: str, placements: Iterable[Placement]) -> Evidence:
    placements = tuple(placements)
    names = [placement.object for placement in placements]
    for placement in placements:
        _require_known(world, placement.object)
        require_in_scene(world, operation, "relative_to", placement.relative_to)
        if placement.object not in world.parked:
            raise ChangeError.seen(
                f"{operation}.object",
                placement.object,
                " is in the scene already and cannot be brought back."
                " Take it out in the event's setup (remove_object), and insert it once.",
            )
    # All targets are computed before anything moves, and nothing moves unless everything can.
    targets = []
    for placement in placements:
        position = world.position(placement.relative_to) + placement.offset_m
        if placement.preserve_initial_z:
            position[2] = world.parked_pose(placement.object)[0][2]
        targets.append(position)
    before, former = measure_poses(world, names), _parked_poses(world, names)
    for name, target in zip(names, targets, strict=True):
        world.unpark(name, target)
    after = measure_poses(world, names)
    return Evidence(operation, tuple(sorted(pose_factors(names))), before, after, {"parked": former})


def _parked_poses(world: AlterableWorld, names: Iterable[str]) -> dict[str, list[float]]:
    """Return the poses (m and wxyz) that those of the objects which are out of the scene had in it."""
    poses = {name: world.parked_pose(name) for name in names if name in world.parked}
    return {name: [*position.tolist(), *turn.tolist()] for name, (position, turn) in poses.items()}


def _pose_reversal(
    change: MoveObject | TurnObject | PutObject | RemoveObject | InsertObstacle | InsertDistractors,
    evidence: Evidence,
) -> Reversal:
    check_evidence(change, evidence)
    names = [name for name in evidence.before["position_m"] if _moved(evidence, name)]
    out = evidence.before["taken_out"]
    parked = [
        (name, tuple(evidence.before["position_m"][name]), tuple(saved(evidence, "parked")[name]))
        for name in names
        if name in out
    ]
    placed = former_poses(evidence, [name for name in names if name not in out])
    return Reversal(change.operation, change.factors, placed=placed, parked=tuple(parked))


def _moved(evidence: Evidence, name: str) -> bool:
    """Return True if a change has altered the pose of an entity, or brought it into or out of the scene."""
    before, after = evidence.before, evidence.after
    poses = any(before[key][name] != after[key][name] for key in ("position_m", "quaternion_wxyz"))
    return poses or (name in before["taken_out"]) != (name in after["taken_out"])


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


def pose_factors(names: Iterable[str]) -> frozenset[Factor]:
    """Return the factors of a change that moves the entities named."""
    return frozenset(f"pose:{name}" for name in names)


def _objects(world: AlterableWorld) -> list[str]:
    return [name for name, entity in world.entities.items() if entity.kind == "object"]


def _yawed(turn: Array, yaw_degrees: float) -> rotations.Quaternion:
    return rotations.unit_by_hypot(rotations.yawed(rotations.quaternion(turn), yaw_degrees))
