"""Changes of the look of surfaces: their colours, and the textures they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from pytest_libero_max.benchmark.structs import Text, rule
from pytest_libero_max.changes.alteration import Alteration, Blended
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import Share, Times3, Vector3
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.errors import ChangeError, EntityError, did_you_mean
from pytest_libero_max.worlds.contract import AlterableWorld
from pytest_libero_max.worlds.scenery import Colours

_Channel = Annotated[int, rule("an integer from 0 to 2", ge=0, le=2)]


class _MaterialChange(Alteration):
    touched: ClassVar[frozenset[Factor]] = frozenset({"material"})


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
        surfaces = world.surfaces()
        return {
            "geom_rgba_mean": _mean_colour(surfaces.parts),
            "mat_rgba_mean": _mean_colour(surfaces.materials),
        }

    def _alter(self, world: AlterableWorld) -> None:
        if self.share > 0.0:
            surfaces = world.surfaces()
            parts, materials = self._recoloured(surfaces.parts), self._recoloured(surfaces.materials)
            world.set_surfaces(replace(surfaces, parts=parts, materials=materials))

    def _recoloured(self, rgba: Colours) -> Colours:
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

    def _alter(self, world: AlterableWorld) -> None:
        texture = _number_in(world.textures, "set_texture.texture", self.texture)
        _show(world, [self._material(world)], texture, None)

    def _material(self, world: AlterableWorld) -> int:
        return _number_in(world.materials, "set_texture.material", self.material)


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
        return _measure_materials(world, self._materials(world))

    def _alter(self, world: AlterableWorld) -> None:
        texture = -1
        if self.texture is not None:
            texture = _number_in(world.textures, "cover_entity.texture", self.texture)
        _show(world, self._materials(world), texture, self.rgb)

    def _materials(self, world: AlterableWorld) -> Sequence[int]:
        if self.entity not in world.entities:
            raise EntityError.seen(
                "entity", self.entity, f" is not in the scene. {did_you_mean(self.entity, world.entities)}"
            )
        return world.materials_of(self.entity)


def _mean_colour(rgba: Colours) -> list[float] | None:
    return [float(value) for value in rgba.mean(axis=0)] if len(rgba) else None


def _show(world: AlterableWorld, materials: Sequence[int], texture: int, rgb: Vector3 | None) -> None:
    """Let materials show a texture, painted over together with their parts unless ``rgb`` is None."""
    if not materials:
        return
    surfaces, chosen = world.surfaces(), list(materials)
    surfaces.textures[chosen] = texture
    if rgb is not None:
        surfaces.materials[chosen, :3] = rgb
        surfaces.parts[np.isin(surfaces.material_of, chosen), :3] = rgb
    world.set_surfaces(surfaces)


def _number_in(known: Sequence[str], where: str, name: str) -> int:
    if name not in known:
        raise ChangeError.seen(where, name, f" is not in the scene. {did_you_mean(name, known)}")
    return known.index(name)


def _measure_materials(world: AlterableWorld, materials: Sequence[int]) -> dict[str, Any]:
    surfaces, names = world.surfaces(), world.materials
    return {
        "materials": [names[material] for material in materials],
        "textures": [int(surfaces.textures[material]) for material in materials],
        "mat_rgba": [surfaces.materials[material].tolist() for material in materials],
    }
