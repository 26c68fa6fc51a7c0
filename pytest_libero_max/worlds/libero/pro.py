"""LIBERO-PRO's variations that need nothing but LIBERO's own files, done as its published runtime does them.

The released LIBERO-PRO cases of these categories start from LIBERO's scenes and initial states; what is
changed is changed after the initial state has been set, with constants that are the same for every task:

- ``semantic``: only the instruction, which the case holds;
- ``camera_view_angle``: one absolute pose of the agent's camera, whatever the scene;
- ``object_texture``: the goal's destinations are tinted. The texture stays: the runtime takes it off a
  material whose copy on the graphics card keeps it;
- ``object_shape``: nothing. The runtime scales meshes of a model that has been compiled already, which
  changes neither the picture nor the collisions.

The other categories place objects by a search, or need task files and models of LIBERO-PRO's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.errors import SubstrateError

import mujoco  # isort: skip - the rooms above have settled its backend

if TYPE_CHECKING:
    from pytest_libero_max.worlds.libero.world import LiberoWorld

CATEGORIES = ("semantic", "camera_view_angle", "object_texture", "object_shape")
"""What can be played without LIBERO-PRO's files."""

CAMERA_POSITION_M = (0.48, 0.24, 1.62)
CAMERA_QUATERNION_WXYZ = (0.6099232, 0.3594558, 0.3594558, 0.6099232)

TINTS = {
    "main_table": (0.72, 0.63, 0.50, 1.0),
    "kitchen_table": (0.72, 0.63, 0.50, 1.0),
    "floor": (0.35, 0.34, 0.32, 1.0),
    "living_room_table": (0.30, 0.20, 0.12, 1.0),
    "study_table": (0.50, 0.36, 0.20, 1.0),
}
"""Colour of the tint by the surface of the scene, rgba."""

_VISIBLE = 1
"""The geom group that is drawn and does not collide."""


@dataclass(frozen=True)
class ProVariation:
    """What the published runtime does to a scene once its initial state has been set.

    Attributes:
        category: One of :data:`CATEGORIES`.
    """

    category: str

    def __post_init__(self) -> None:
        if self.category not in CATEGORIES:
            raise SubstrateError(
                f"LIBERO-PRO's category {self.category!r} needs task files, models or a placement search of "
                f"its own, which the genuine substrate does not use yet. It plays {', '.join(CATEGORIES)}."
            )

    def apply(self, world: LiberoWorld) -> None:
        """Make the changes to a world that has just been reset."""
        if self.category == "camera_view_angle":
            camera = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_CAMERA, "agentview")
            world.alter("cam_pos", camera, CAMERA_POSITION_M)
            world.alter("cam_quat", camera, CAMERA_QUATERNION_WXYZ)
        elif self.category == "object_texture":
            surface = next(entity.name for entity in world.entities.values() if entity.kind == "surface")
            for entity in tinted_entities(world):
                _tint(world, entity, TINTS[surface])


def tinted_entities(world: LiberoWorld) -> tuple[str, ...]:
    """The goal's destinations; where it has none but the work surface, what it is about."""
    destinations: list[str] = []
    subjects: list[str] = []
    for fact in world.goal:
        owners = [_owner(world, argument) for argument in fact.words()[1:]]
        subjects.append(owners[0])
        destinations += owners if fact.place is None else owners[1:]
    found = [name for name in destinations if world.entities[name].kind != "surface"]
    return tuple(dict.fromkeys(found or subjects))


def _owner(world: LiberoWorld, name: str) -> str:
    """The entity of that name, or the one whose region it is."""
    owners = [entity for entity in world.entities if name == entity or name.startswith(f"{entity}_")]
    return max(owners, key=len)


def _tint(world: LiberoWorld, entity: str, rgba: tuple[float, ...]) -> None:
    model = world.model
    geoms = [int(geom) for geom in world._geoms(entity) if model.geom_group[geom] == _VISIBLE]
    for geom in geoms:
        world.alter("geom_rgba", geom, rgba)
    materials = {int(model.geom_matid[geom]) for geom in geoms}
    for material in sorted(materials - {-1}):
        world.alter("mat_rgba", material, np.array(rgba))
