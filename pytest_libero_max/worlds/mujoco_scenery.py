"""The scenery of a world on MuJoCo: cameras, lights and surfaces of a compiled model, read and written."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import EntityError, SubstrateError, did_you_mean
from pytest_libero_max.worlds.contract import Array, Entity
from pytest_libero_max.worlds.rotations import fused_dot
from pytest_libero_max.worlds.scenery import CameraView, Lights, Surfaces

if TYPE_CHECKING:
    import mujoco

ALTERABLE = (
    "body_pos",
    "body_quat",
    "cam_fovy",
    "cam_pos",
    "cam_quat",
    "geom_conaffinity",
    "geom_contype",
    "geom_group",
    "geom_matid",
    "geom_rgba",
    "light_active",
    "light_ambient",
    "light_castshadow",
    "light_cutoff",
    "light_diffuse",
    "light_dir",
    "light_exponent",
    "light_pos",
    "light_specular",
    "mat_emission",
    "mat_rgba",
    "mat_shininess",
    "mat_specular",
    "mat_texid",
    "mat_texrepeat",
    "site_rgba",
)
"""Model fields that may change after compilation. All of them are part of a snapshot and of the digest,
and a reset writes the compiled values back."""

_COLOUR_ROLE = 1
"""Column of ``mat_texid`` that holds the colour texture (mjTEXROLE_RGB)."""
_DRAWN_GROUP = 1
_BOX = 6  # mjGEOM_BOX

_LIGHTS = MappingProxyType(
    {
        "ambient": "light_ambient",
        "diffuse": "light_diffuse",
        "specular": "light_specular",
        "direction": "light_dir",
        "casts_shadow": "light_castshadow",
    }
)
"""Model fields by the names that :class:`.scenery.Lights` gives them."""


class MujocoScenery(ABC):
    """The scenery of a compiled model, for a world that has it as ``_model``."""

    alterable_fields: ClassVar[tuple[str, ...]] = ALTERABLE
    """Model fields that may change; more in a world whose episodes write others as well."""

    _model: mujoco.MjModel
    _data: mujoco.MjData
    _entities: dict[str, Entity]
    _alterable: Mapping[str, NDArray[Any]]
    """The model's own arrays by the names in :data:`ALTERABLE`."""

    @abstractmethod
    def _settle(self) -> None:
        """Bring derived data up to date with the current state, which stays as it is."""

    @abstractmethod
    def _after_alteration(self) -> None:
        """Follow-up of an alteration from outside, once the world is settled in its altered state."""

    def alter(self, field: str, index: int | slice, value: Any) -> None:
        """Write ``model.<field>[index] = value`` for an alterable field and bring derived data up to date.

        Raises:
            SubstrateError: The field is not one that a reset restores.
        """
        if field not in self.alterable_fields:
            raise SubstrateError(
                f"field={field!r} is not a model field that a reset restores, so it must not be altered. "
                f"{did_you_mean(field, self.alterable_fields)}"
            )
        self._write({field: value}, index)

    def _write(self, values: Mapping[str, Any], index: int | slice = slice(None)) -> None:
        for field, value in values.items():
            self._alterable[field][index] = value
        self._settle()
        self._after_alteration()

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(self._model.camera(number).name for number in range(self._model.ncam))

    def view(self, camera: str) -> CameraView:
        model, number = self._model, self._camera_number(camera)
        return CameraView(
            model.cam_pos[number].copy(), model.cam_quat[number].copy(), float(model.cam_fovy[number])
        )

    def set_view(self, camera: str, view: CameraView) -> None:
        values = {"cam_pos": view.position_m, "cam_quat": view.quaternion_wxyz, "cam_fovy": view.fovy_deg}
        self._write(values, self._camera_number(camera))

    def _camera_number(self, camera: str) -> int:
        if camera not in self.cameras:
            raise SubstrateError(f"camera={camera!r}. {did_you_mean(camera, self.cameras)}")
        return self.cameras.index(camera)

    def lights(self) -> Lights:
        return Lights(**{name: getattr(self._model, field).copy() for name, field in _LIGHTS.items()})

    def set_lights(self, lights: Lights) -> None:
        self._write({field: getattr(lights, name) for name, field in _LIGHTS.items()})

    @property
    def materials(self) -> tuple[str, ...]:
        return tuple(self._model.mat(number).name for number in range(self._model.nmat))

    @property
    def textures(self) -> tuple[str, ...]:
        return tuple(self._model.tex(number).name for number in range(self._model.ntex))

    def surfaces(self) -> Surfaces:
        model = self._model
        return Surfaces(
            parts=model.geom_rgba.copy(),
            material_of=model.geom_matid.copy(),
            materials=model.mat_rgba.copy(),
            textures=model.mat_texid[:, _COLOUR_ROLE].copy(),
        )

    def set_surfaces(self, surfaces: Surfaces) -> None:
        self._alterable["mat_texid"][:, _COLOUR_ROLE] = surfaces.textures
        self._write(
            {
                "geom_rgba": surfaces.parts,
                "geom_matid": surfaces.material_of,
                "mat_rgba": surfaces.materials,
            }
        )

    def materials_of(self, entity: str) -> tuple[int, ...]:
        model, root = self._model, self._root(entity)
        inside = {root}
        for body in range(root + 1, model.nbody):
            if int(model.body_parentid[body]) in inside:
                inside.add(body)
        drawn = [
            int(model.geom_matid[geom])
            for geom in range(model.ngeom)
            if int(model.geom_bodyid[geom]) in inside and model.geom_group[geom] == _DRAWN_GROUP
        ]
        return tuple(sorted({material for material in drawn if material >= 0}))

    def velocity(self, entity: str) -> Array:
        first = int(self._model.body(self._root(entity)).dofadr[0])
        velocity: Array = self._data.qvel[first : first + 3].copy()
        return velocity

    def top_m(self, entity: str) -> float | None:
        model, data = self._model, self._data
        heights = []
        for geom in self._touchable(entity):
            up = data.geom_xmat[geom].reshape(3, 3)[2]
            box = model.geom_type[geom] == _BOX
            half = fused_dot(np.abs(up), model.geom_size[geom]) if box else float(model.geom_rbound[geom])
            heights.append(float(data.geom_xpos[geom][2]) + half)
        return max(heights, default=None)

    def radius_m(self, entity: str) -> float:
        model, data = self._model, self._data
        origin = data.xpos[self._root(entity)]
        return max(
            (
                _length(data.geom_xpos[geom] - origin) + float(model.geom_rbound[geom])
                for geom in self._touchable(entity)
            ),
            default=0.0,
        )

    def _touchable(self, entity: str) -> Iterator[int]:
        """Return the colliding geoms of an entity."""
        model = self._model
        inside = model.body_rootid[model.geom_bodyid] == self._root(entity)
        colliding = (model.geom_contype | model.geom_conaffinity) != 0
        return map(int, np.flatnonzero(inside & colliding))

    def _root(self, entity: str) -> int:
        if entity not in self._entities:
            raise EntityError.seen(
                "entity", entity, f" is not in the scene. {did_you_mean(entity, self._entities)}"
            )
        return int(self._model.body(self._entities[entity].body).id)


def _length(vector: Array) -> float:
    return math.sqrt(fused_dot(vector, vector))
