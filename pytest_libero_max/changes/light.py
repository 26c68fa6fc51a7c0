"""Changes of the light: the intensity of the lamps with the exposure, and each property of the lamps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np

from pytest_libero_max.changes.alteration import Alteration, Blended
from pytest_libero_max.changes.factors import Factor, filter_records
from pytest_libero_max.changes.fields import (
    Degrees,
    Share,
    Times,
    Times3,
    between,
)
from pytest_libero_max.changes.pixels import Brightness
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, Array

_INTENSITIES = ("ambient", "diffuse", "specular")
DARKENED, BRIGHTENED = 0.75, 1.25
"""Brightness of the images when the lamps are dimmed, and when they are not."""


@dataclass(frozen=True)
class SetLighting(Alteration):
    """Multiply the intensity of every lamp, and the brightness of every image from now on."""

    operation: ClassVar[str] = "set_lighting"
    touched: ClassVar[frozenset[Factor]] = frozenset({"light", "pixels"})

    scale: Times
    """Times on the ambient, diffuse and specular intensity of every light, at least 0."""
    brightness: Times | None = None
    """Factor on the pixels. None means the benchmark's rule: 0.75 where ``scale`` is below 1, otherwise 1.25.
    A change that :meth:`scaled` returned states it."""

    @property
    def pixel_brightness(self) -> float:
        """The factor on the pixels, by rule or as stated."""
        if self.brightness is not None:
            return self.brightness
        return DARKENED if self.scale < 1.0 else BRIGHTENED

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        lights = world.lights()
        lamps: dict[str, Any] = {f"light_{name}": getattr(lights, name).tolist() for name in _INTENSITIES}
        return {**lamps, "filters": filter_records(world)}

    def _alter(self, world: AlterableWorld) -> None:
        if self.scale != 1.0:
            lights = world.lights()
            scaled = {name: getattr(lights, name) * self.scale for name in _INTENSITIES}
            world.set_lights(replace(lights, **scaled))
        if self.pixel_brightness != 1.0:
            world.add_filter(Brightness(self.pixel_brightness))

    def _at(self, strength: float) -> SetLighting:
        """Return the change with both factors moved from 1 towards their full value."""
        return SetLighting(
            1.0 + (self.scale - 1.0) * strength, 1.0 + (self.pixel_brightness - 1.0) * strength
        )


_LAMP_FIELDS = MappingProxyType(
    {
        "light_ambient": "ambient",
        "light_castshadow": "casts_shadow",
        "light_diffuse": "diffuse",
        "light_dir": "direction",
        "light_specular": "specular",
    }
)
"""Fields of :class:`.Lights` by the names that evidence gives them."""
_LOWEST_LAMP_DEG = 80.0
"""A lamp is never turned closer to the horizon than 10 degrees."""


@dataclass(frozen=True)
class SetLamps(Blended):
    """Alter every lamp of the scene; properties that are not given stay."""

    operation: ClassVar[str] = "set_lamps"
    touched: ClassVar[frozenset[Factor]] = frozenset({"light"})

    levels: Times3 | None = None
    """Ambient, diffuse and specular intensity of every lamp, absolute, the same for all channels."""
    diffuse_factor: Times3 | None = None
    """Factor on the red, green and blue of the diffuse and ambient light."""
    specular: Annotated[float, between(0.0, 10.0)] | None = None
    """Specular intensity of every lamp, absolute."""
    azimuth_degrees: Degrees | None = None
    """Turn of the lamps' direction about the vertical."""
    tilt_degrees: Annotated[float, between(-90.0, 90.0)] | None = None
    """Turn of the lamps' direction away from the vertical; negative towards it."""
    cast_shadows: bool | None = None
    """True lets the first lamp, the main one, cast shadows."""
    blend: Share | None = None
    """Share of all that, 0 to 1; None means all of it."""

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        lights = world.lights()
        return {name: getattr(lights, field).tolist() for name, field in _LAMP_FIELDS.items()}

    def _at(self, strength: float) -> SetLamps:
        if self.cast_shadows is not None and strength:
            raise ChangeError.seen(
                "strength", strength, f", but {self.operation} with shadows is all or nothing. Use 0 or 1."
            )
        return super()._at(strength)

    def _alter(self, world: AlterableWorld) -> None:
        lights, share = world.lights(), self.share
        if share == 0.0:
            return
        new: dict[str, Any] = {}
        for position, name in enumerate(_INTENSITIES):
            old = getattr(lights, name).astype(np.float64)
            full = self._intensity(name, position, old)
            if not np.array_equal(full, old):
                new[name] = old + (full - old) * share
        if self.azimuth_degrees or self.tilt_degrees:
            new["direction"] = np.array([self._direction(way, share) for way in lights.direction])
        if self.cast_shadows is not None:
            new["casts_shadow"] = lights.casts_shadow.copy()
            new["casts_shadow"][0] = self.cast_shadows
        if new:
            world.set_lights(replace(lights, **new))

    def _intensity(self, name: str, position: int, old: Array) -> Array:
        """Return an intensity (n, 3) of the lamps after all of the change."""
        new = old.copy()
        if self.levels is not None:
            new[:] = self.levels[position]
        if self.diffuse_factor is not None and name != "specular":
            new *= self.diffuse_factor
        if self.specular is not None and name == "specular":
            new[:] = self.specular
        return new

    def _direction(self, direction: Array, share: float) -> list[float]:
        x, y, z = (float(part) for part in direction)
        azimuth = math.atan2(y, x) + math.radians((self.azimuth_degrees or 0.0) * share)
        # Rounding may leave the quotient a hair beyond 1, for which acos raises.
        polar = math.degrees(math.acos(max(-1.0, min(1.0, -z / math.hypot(x, y, z)))))
        polar = min(max(polar + (self.tilt_degrees or 0.0) * share, 0.0), _LOWEST_LAMP_DEG)
        away = math.sin(math.radians(polar))
        return [math.cos(azimuth) * away, math.sin(azimuth) * away, -math.cos(math.radians(polar))]
