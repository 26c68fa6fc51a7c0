"""Where a gripper takes hold of the parts of a scene: handles of drawers and doors, knobs, necks, rims.

For policies that are privileged. A scene's part has the name ``<instance>_<part>``, for example
``wooden_cabinet_1_top_handle``, ``flat_stove_1_knob`` or ``wine_bottle_1_neck``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.embedded import rotations
from pytest_libero_max.worlds.embedded.objects import category
from pytest_libero_max.worlds.embedded.scene import Scene, links

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Holding:
    """A part of a scene that is made to be held.

    Attributes:
        name: ``<instance>_<part>``.
        entity: Whose part it is.
        body: MuJoCo body that it is fixed to; the frame of the vectors below.
        joint: The joint that it moves, or None for objects.
        pos: Middle of the part, m.
        along: Unit vector along it; fingers close across it.
        out: Unit vector away from the entity, against which the hand approaches.
        width: How far apart the fingers end up, m.
    """

    name: str
    entity: str
    body: str
    joint: str | None
    pos: tuple[float, float, float]
    along: tuple[float, float, float]
    out: tuple[float, float, float]
    width: float

    def world(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Where it is now: position (m), ``along`` and ``out``, each (3,) in the world frame."""
        body = data.body(self.body)
        frame = body.xmat.reshape(3, 3)
        return body.xpos + frame @ self.pos, frame @ self.along, frame @ self.out

    def motion(self, data: mujoco.MjData) -> Array:
        """Velocity (3,), world, of the part per unit of its joint's velocity; 0 without a joint."""
        if self.joint is None:
            return np.zeros(3)
        joint = data.joint(self.joint)
        if data.model.joint(self.joint).type[0] == _SLIDE:
            return np.array(joint.xaxis)
        velocity: Array = np.cross(joint.xaxis, self.world(data)[0] - joint.xanchor)
        return velocity


_SLIDE = 2  # mjJNT_SLIDE; MuJoCo itself is imported by whoever has a model


def holdings(scene: Scene) -> Mapping[str, Holding]:
    """Every part of a scene that is made to be held, by name."""
    found = {}
    for entity in scene.entities.values():
        if entity.kind == "surface":
            continue
        kind = category(entity.category)
        back = rotations.matrix(rotations.inverse(kind.upright))
        for link in links(kind.root):
            joint = None if link.joint is None else f"{entity.name}_{link.joint.name}"
            for grip in link.grips:
                name = f"{entity.name}_{grip.name}"
                pos, along, out = (_vector(back @ vector) for vector in (grip.pos, grip.along, grip.out))
                found[name] = Holding(
                    name, entity.name, f"{entity.name}_{link.name}", joint, pos, along, out, grip.width
                )
    return found


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z
