"""Changes of where things stand that need more than a shift: put down on something, turned on the spot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import (
    ManifestFields,
    all_or_nothing,
    items,
    number,
    strength_of,
    text,
)
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.poses import measure_poses, pose_factors, require_in_scene
from pytest_libero_max.errors import ChangeError, EntityError, did_you_mean
from pytest_libero_max.worlds.contract import Array, World

_STEP_M, _BISECTIONS, _MAX_STEPS = 0.004, 12, 500
_FAR_ABOVE_M = 1.0
_BOX = 6  # mjGEOM_BOX


@dataclass(frozen=True)
class PutObject(ManifestFields):
    """Put an object down on something, a hair above touching it; one that was taken out comes back for it.

    All or nothing: it cannot be scaled to anything between.

    Attributes:
        object: What to put.
        onto: The entity it is to rest on: a table, a floor, a fixture or another object.
        relative_to: The entity whose position is the origin of the offset; None for the world's origin.
        offset_xy_m: From there to the object, world frame.
        yaw_degrees: Turn about the vertical from the orientation it has, or had when it was taken out.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "put_object"

    object: str
    onto: str
    offset_xy_m: tuple[float, float]
    relative_to: str | None = None
    yaw_degrees: float = 0.0

    def __post_init__(self) -> None:
        where = self.operation
        text(f"{where}.object", self.object)
        text(f"{where}.onto", self.onto)
        given = items(f"{where}.offset_xy_m", self.offset_xy_m, 2)
        self._set("offset_xy_m", tuple(number(f"{where}.offset_xy_m[{i}]", v) for i, v in enumerate(given)))
        if self.relative_to is not None:
            text(f"{where}.relative_to", self.relative_to)
        self._set("yaw_degrees", number(f"{where}.yaw_degrees", self.yaw_degrees, -180.0, 180.0))

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: World) -> Evidence:
        if self.object not in world.entities:
            raise EntityError(
                f"entity={self.object!r} is not in the scene. {did_you_mean(self.object, world.entities)}"
            )
        kind = world.entities[self.object].kind
        if kind != "object":
            raise ChangeError(f"put_object.object={self.object!r} is a {kind}, but only objects can be put.")
        require_in_scene(world, self.operation, "onto", self.onto)
        before = measure_poses(world, [self.object])
        x, y = self.offset_xy_m
        if self.relative_to is not None:
            require_in_scene(world, self.operation, "relative_to", self.relative_to)
            anchor = world.position(self.relative_to)
            x, y = float(anchor[0]) + x, float(anchor[1]) + y
        above = _top(world, self.onto)
        if self.object in world.parked:
            world.unpark(self.object, (x, y, above + _FAR_ABOVE_M))  # its size is not known before
        start = np.array([x, y, above + _reach(world, self.object)])
        turn = world.pose(self.object)[1]
        world.place(self.object, start, _turned(turn, self.yaw_degrees) if self.yaw_degrees else None)
        _lower(world, self.object, self.onto, start)
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, measure_poses(world, [self.object])
        )

    def scaled(self, strength: float) -> PutObject | Nothing:
        """The move at strength 1, nothing at strength 0; there is nothing between."""
        return self if all_or_nothing(self.operation, strength) else Nothing()


@dataclass(frozen=True)
class TurnObject(ManifestFields):
    """Turn an object or a fixture about the vertical through its origin; it is at rest afterwards.

    Attributes:
        object: The entity to turn.
        yaw_degrees: Counter-clockwise seen from above.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "turn_object"

    object: str
    yaw_degrees: float

    def __post_init__(self) -> None:
        text("turn_object.object", self.object)
        self._set("yaw_degrees", number("turn_object.yaw_degrees", self.yaw_degrees, -180.0, 180.0))

    @property
    def factors(self) -> frozenset[Factor]:
        return pose_factors([self.object])

    def apply(self, world: World) -> Evidence:
        require_in_scene(world, self.operation, "object", self.object)
        if world.entities[self.object].kind == "surface":
            raise ChangeError(
                f"turn_object.object={self.object!r} is the surface that others stand on. "
                "Name an object or a fixture."
            )
        before = measure_poses(world, [self.object])
        if self.yaw_degrees:
            position, turn = world.pose(self.object)
            world.place(self.object, position, _turned(turn, self.yaw_degrees))
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, measure_poses(world, [self.object])
        )

    def scaled(self, strength: float) -> TurnObject:
        """The angle multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, yaw_degrees=self.yaw_degrees * s)


def _lower(world: World, name: str, onto: str, start: Array) -> None:
    """Let an object down until it would touch, and leave it a few micrometres above that."""
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
    meets(free)


def _geoms(world: World, name: str) -> list[int]:
    """The colliding geoms of an entity."""
    model = world.model
    root = model.body(world.entities[name].body).id
    inside = model.body_rootid[model.geom_bodyid] == root
    return [int(geom) for geom in np.flatnonzero(inside & (model.geom_group == 0))]


def _top(world: World, name: str) -> float:
    """Height of an entity's highest point, m."""
    model, data = world.model, world.data
    heights = []
    for geom in _geoms(world, name):
        up = data.geom_xmat[geom].reshape(3, 3)[2]
        box = model.geom_type[geom] == _BOX
        reach = float(np.abs(up) @ model.geom_size[geom]) if box else float(model.geom_rbound[geom])
        heights.append(float(data.geom_xpos[geom][2]) + reach)
    if not heights:
        raise ChangeError(f"put_object.onto={name!r} has nothing that could carry anything.")
    return max(heights)


def _reach(world: World, name: str) -> float:
    """Distance from an object's origin to its farthest point, m, at most."""
    model, data = world.model, world.data
    origin = data.body(world.entities[name].body).xpos
    return max(
        float(np.linalg.norm(data.geom_xpos[geom] - origin) + model.geom_rbound[geom])
        for geom in _geoms(world, name)
    )


def _turned(quaternion: Array, yaw_degrees: float) -> Array:
    """``Rz(yaw) * quaternion`` (wxyz), normalised."""
    half = math.radians(yaw_degrees) / 2
    c, s = math.cos(half), math.sin(half)
    w, x, y, z = (float(part) for part in quaternion)
    turned = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
    norm = math.hypot(*turned)
    return np.array(turned) / norm
