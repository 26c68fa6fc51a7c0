"""Lower an object onto another one: from above, down to the height at which the two would touch."""

from __future__ import annotations

import math

import numpy as np

from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, Array
from pytest_libero_max.worlds.rotations import fused_dot

_STEP_M, _BISECTIONS, _MAX_STEPS = 0.004, 12, 500
_BOX = 6  # mjGEOM_BOX


def lower(world: AlterableWorld, name: str, onto: str, start: Array) -> None:
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


def _geoms(world: AlterableWorld, name: str) -> list[int]:
    """Return the colliding geoms of an entity."""
    model = world.model
    root = model.body(world.entities[name].body).id
    inside = model.body_rootid[model.geom_bodyid] == root
    return [int(geom) for geom in np.flatnonzero(inside & (model.geom_group == 0))]


def top(world: AlterableWorld, name: str) -> float:
    """Return the height of an entity's highest point, m."""
    model, data = world.model, world.data
    heights = []
    for geom in _geoms(world, name):
        up = data.geom_xmat[geom].reshape(3, 3)[2]
        box = model.geom_type[geom] == _BOX
        reach = fused_dot(np.abs(up), model.geom_size[geom]) if box else float(model.geom_rbound[geom])
        heights.append(float(data.geom_xpos[geom][2]) + reach)
    if not heights:
        raise ChangeError.seen("put_object.onto", name, " has nothing that could carry anything.")
    return max(heights)


def reach(world: AlterableWorld, name: str) -> float:
    """Return the distance from an object's origin to its farthest point, m, at most."""
    model, data = world.model, world.data
    origin = data.body(world.entities[name].body).xpos
    return max(
        _length(data.geom_xpos[geom] - origin) + float(model.geom_rbound[geom])
        for geom in _geoms(world, name)
    )


def _length(vector: Array) -> float:
    return math.sqrt(fused_dot(vector, vector))
