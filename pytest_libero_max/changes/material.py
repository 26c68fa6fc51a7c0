"""Changes of what surfaces look like."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import (
    ManifestFields,
    Vector3,
    integer,
    items,
    number,
    strength_of,
    vector3,
)
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import World

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLOUR_FIELDS = ("geom_rgba", "mat_rgba")


@dataclass(frozen=True)
class SetVisualTheme(ManifestFields):
    """Send the colour of every geom and every material through one fixed transform; opacity stays.

    The new colour is ``clip(rgb[permutation] * multiplier, 0, 1)``, mixed with the old one by ``blend``.

    Attributes:
        rgb_permutation: Which old channel becomes red, green and blue: a permutation of 0, 1, 2.
        rgb_multiplier: Factor on each new channel, at least 0.
        blend: Share of the new colour, 0 to 1; None means all of it.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_visual_theme"

    rgb_permutation: tuple[int, int, int]
    rgb_multiplier: Vector3
    blend: float | None = None

    def __post_init__(self) -> None:
        where = "set_visual_theme.rgb_permutation"
        given = items(where, self.rgb_permutation, 3)
        permutation = tuple(integer(f"{where}[{i}]", item, 0, 2) for i, item in enumerate(given))
        if sorted(permutation) != [0, 1, 2]:
            raise ChangeError(f"{where}={list(permutation)!r}, but must be a permutation of [0, 1, 2].")
        self._set("rgb_permutation", permutation)
        self._set("rgb_multiplier", vector3("set_visual_theme.rgb_multiplier", self.rgb_multiplier, 0.0))
        if self.blend is not None:
            self._set("blend", number("set_visual_theme.blend", self.blend, 0.0, 1.0))

    @property
    def share(self) -> float:
        """Share of the new colour, 0 to 1."""
        return 1.0 if self.blend is None else self.blend

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"material"})

    def apply(self, world: World) -> Evidence:
        before = _measure(world)
        if self.share > 0.0:
            for field in COLOUR_FIELDS:
                world.alter(field, slice(None), self._recoloured(getattr(world.model, field)))
        return Evidence(self.operation, tuple(sorted(self.factors)), before, _measure(world))

    def scaled(self, strength: float) -> SetVisualTheme:
        """The theme blended into the original colours: its share multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, blend=self.share * s)

    def _recoloured(self, rgba: NDArray[np.float32]) -> NDArray[np.float32]:
        new = rgba.copy()
        themed = (rgba[:, list(self.rgb_permutation)] * self.rgb_multiplier).clip(0.0, 1.0)
        new[:, :3] = themed if self.share == 1.0 else (1.0 - self.share) * rgba[:, :3] + self.share * themed
        return new


def _measure(world: World) -> dict[str, Any]:
    """Mean colours: enough to see the transform, small enough for every record."""
    means = {}
    for field in COLOUR_FIELDS:
        rgba = getattr(world.model, field)
        means[f"{field}_mean"] = [float(value) for value in rgba.mean(axis=0)] if len(rgba) else None
    return means
