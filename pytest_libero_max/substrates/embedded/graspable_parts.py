"""Where a gripper takes hold of the parts of a scene: handles of drawers and doors, knobs, necks, rims.

For policies that are privileged. A scene's part has the name ``<instance>_<part>``, for example
``wooden_cabinet_1_top_handle``, ``flat_stove_1_knob`` or ``wine_bottle_1_neck``.
"""

from __future__ import annotations

from collections.abc import Mapping

from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.scene import Scene, links
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.privileged import GraspablePart


def graspable_parts(scene: Scene) -> Mapping[str, GraspablePart]:
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
                found[name] = GraspablePart(
                    name, entity.name, f"{entity.name}_{link.name}", joint, pos, along, out, grip.width
                )
    return found


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z
