"""Changes of the light: the lamps of the scene, and the exposure that goes with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import ManifestFields, number, strength_of
from pytest_libero_max.changes.pixels import Brightness, filter_records
from pytest_libero_max.worlds.contract import World

LIGHT_FIELDS = ("light_ambient", "light_diffuse", "light_specular")
DARKENED, BRIGHTENED = 0.75, 1.25
"""Brightness of the images when the lamps are dimmed, and when they are not."""


@dataclass(frozen=True)
class SetLighting(ManifestFields):
    """Multiply the intensity of every lamp, and the brightness of every image from now on.

    Attributes:
        scale: Factor on the ambient, diffuse and specular intensity of every light, at least 0.
        brightness: Factor on the pixels. None means the benchmark's rule: 0.75 where ``scale`` is below
            1, otherwise 1.25. A change that :meth:`scaled` returned says it outright.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_lighting"

    scale: float
    brightness: float | None = None

    def __post_init__(self) -> None:
        self._set("scale", number("set_lighting.scale", self.scale, 0.0))
        if self.brightness is not None:
            self._set("brightness", number("set_lighting.brightness", self.brightness, 0.0))

    @property
    def pixel_brightness(self) -> float:
        """The factor on the pixels, by rule or as stated."""
        if self.brightness is not None:
            return self.brightness
        return DARKENED if self.scale < 1.0 else BRIGHTENED

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"light", "pixels"})

    def apply(self, world: World) -> Evidence:
        before = _measure(world)
        if self.scale != 1.0:
            for field in LIGHT_FIELDS:
                world.alter(field, slice(None), getattr(world.model, field) * self.scale)
        if self.pixel_brightness != 1.0:
            world.add_filter(Brightness(self.pixel_brightness))
        return Evidence(self.operation, tuple(sorted(self.factors)), before, _measure(world))

    def scaled(self, strength: float) -> SetLighting:
        """Both factors moved from 1 towards their full value: ``1 + (factor - 1) * strength``."""
        s = strength_of(self.operation, strength)
        if s == 1.0:
            return self
        return SetLighting(1.0 + (self.scale - 1.0) * s, 1.0 + (self.pixel_brightness - 1.0) * s)


def _measure(world: World) -> dict[str, Any]:
    lamps: dict[str, Any] = {field: getattr(world.model, field).tolist() for field in LIGHT_FIELDS}
    return {**lamps, "filters": filter_records(world)}
