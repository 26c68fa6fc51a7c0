"""Changes of the look of surfaces: their colours, and the textures they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.structs import Text, rule
from pytest_libero_max.changes.alteration import Alteration, Blended
from pytest_libero_max.changes.change import Evidence, Factor
from pytest_libero_max.changes.fields import Share, Times3, Vector3
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.changes.reversal import Row, frozen, saved
from pytest_libero_max.errors import ChangeError, EntityError, did_you_mean
from pytest_libero_max.worlds.contract import AlterableWorld

COLOUR_FIELDS = ("geom_rgba", "mat_rgba")
COLOUR_ROLE = 1
"""Column of ``mat_texid`` that holds the colour texture (mjTEXROLE_RGB)."""

_Channel = Annotated[int, rule("an integer from 0 to 2", ge=0, le=2)]

_DRAWN_GROUP = 1


class _MaterialChange(Alteration):
    touched: ClassVar[frozenset[Factor]] = frozenset({"material"})

    def _former(self, evidence: Evidence) -> dict[str, Any]:
        rows: list[Row] = [(field, row, frozen(values)) for field, row, values in saved(evidence, "rows")]
        return {"rows": tuple(rows)}


@dataclass(frozen=True)
class SetVisualTheme(_MaterialChange, Blended):
    """Transform the colour of every geom and every material; opacity stays.

    The new colour is ``clip(rgb[permutation] * multiplier, 0, 1)``, mixed with the old one by ``blend``.
    """

    operation: ClassVar[str] = "set_visual_theme"

    rgb_permutation: tuple[_Channel, _Channel, _Channel]
    """Old channel that becomes red, green and blue: a permutation of 0, 1, 2."""
    rgb_multiplier: Times3
    """Factor on each new channel, at least 0."""
    blend: Share | None = None
    """Share of the new colour, 0 to 1; None means all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if sorted(self.rgb_permutation) != [0, 1, 2]:
            raise ChangeError.seen(
                f"{self.operation}.rgb_permutation",
                list(self.rgb_permutation),
                ", but must be a permutation of [0, 1, 2].",
            )

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        """Return the mean colours: enough to see the transform, small enough for every record."""
        means = {}
        for field in COLOUR_FIELDS:
            rgba = getattr(world.model, field)
            means[f"{field}_mean"] = [float(value) for value in rgba.mean(axis=0)] if len(rgba) else None
        return means

    def _alter(self, world: AlterableWorld) -> dict[str, Any]:
        former = []
        if self.share > 0.0:
            for field in COLOUR_FIELDS:
                new = self._recoloured(getattr(world.model, field))
                former.append(_write(world, field, None, new))
        return {"rows": former}

    def _recoloured(self, rgba: NDArray[np.float32]) -> NDArray[np.float32]:
        new = rgba.copy()
        themed = (rgba[:, list(self.rgb_permutation)] * self.rgb_multiplier).clip(0.0, 1.0)
        new[:, :3] = themed if self.share == 1.0 else (1.0 - self.share) * rgba[:, :3] + self.share * themed
        return new


@dataclass(frozen=True)
class SetTexture(Indivisible, _MaterialChange):
    """Show another texture of the scene on a material."""

    operation: ClassVar[str] = "set_texture"

    material: Text
    """Name of the material, for example ``room_table``."""
    texture: Text
    """Name of a texture that the scene has loaded."""

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        return _measure_materials(world, [self._material(world)])

    def _alter(self, world: AlterableWorld) -> dict[str, Any]:
        texture = _number_of(world, "tex", "set_texture.texture", self.texture)
        return {"rows": _show(world, self._material(world), texture, None)}

    def _material(self, world: AlterableWorld) -> int:
        return _number_of(world, "mat", "set_texture.material", self.material)


@dataclass(frozen=True)
class CoverEntity(Indivisible, _MaterialChange):
    """Cover an entity with a texture, or paint it in one colour: its own textures are not seen any more.

    Materials belong to a category, so every instance of the entity's category looks like that afterwards.
    """

    operation: ClassVar[str] = "cover_entity"

    entity: Text
    rgb: tuple[Share, Share, Share]
    """Colour, 0 to 1; multiplies the texture."""
    texture: Text | None = None
    """Name of a texture that the scene has loaded; None paints without any."""

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        return _measure_materials(world, _materials_of(world, self.entity))

    def _alter(self, world: AlterableWorld) -> dict[str, Any]:
        texture = -1
        if self.texture is not None:
            texture = _number_of(world, "tex", "cover_entity.texture", self.texture)
        materials = _materials_of(world, self.entity)
        return {"rows": [row for material in materials for row in _show(world, material, texture, self.rgb)]}


def _write(world: AlterableWorld, field: str, row: int | None, value: Any) -> list[Any]:
    """Write a row of a model field, or all of it; return its reversal: field, row, former values."""
    index = slice(None) if row is None else row
    former = getattr(world.model, field)[index].tolist()
    world.alter(field, index, value)
    return [field, row, former]


def _show(world: AlterableWorld, material: int, texture: int, rgb: Vector3 | None) -> list[list[Any]]:
    """Let a material show a texture, painted over unless ``rgb`` is None; return the reversal."""
    row = world.model.mat_texid[material].copy()
    row[COLOUR_ROLE] = texture
    former = [_write(world, "mat_texid", material, row)]
    if rgb is not None:
        former.append(_write(world, "mat_rgba", material, [*rgb, world.model.mat_rgba[material][3]]))
        for geom in np.flatnonzero(world.model.geom_matid == material):
            colour = [*rgb, world.model.geom_rgba[geom][3]]
            former.append(_write(world, "geom_rgba", int(geom), colour))
    return former


def _materials_of(world: AlterableWorld, entity: str) -> list[int]:
    if entity not in world.entities:
        raise EntityError.seen(
            "entity", entity, f" is not in the scene. {did_you_mean(entity, world.entities)}"
        )
    model = world.model
    root = model.body(world.entities[entity].body).id
    inside = {root}
    for body in range(root + 1, model.nbody):
        if int(model.body_parentid[body]) in inside:
            inside.add(body)
    drawn = [
        int(model.geom_matid[geom])
        for geom in range(model.ngeom)
        if int(model.geom_bodyid[geom]) in inside and model.geom_group[geom] == _DRAWN_GROUP
    ]
    return sorted({material for material in drawn if material >= 0})


def _number_of(world: AlterableWorld, kind: str, where: str, name: str) -> int:
    model = world.model
    count, named = (model.nmat, model.mat) if kind == "mat" else (model.ntex, model.tex)
    known = [named(number).name for number in range(count)]
    if name not in known:
        raise ChangeError.seen(where, name, f" is not in the scene. {did_you_mean(name, known)}")
    return known.index(name)


def _measure_materials(world: AlterableWorld, materials: Sequence[int]) -> dict[str, Any]:
    model = world.model
    return {
        "materials": [model.mat(material).name for material in materials],
        "textures": [int(model.mat_texid[material][COLOUR_ROLE]) for material in materials],
        "mat_rgba": [model.mat_rgba[material].tolist() for material in materials],
    }
