"""Values that a scene consists of and that a change may alter: views of cameras, lights, surfaces.

A world returns copies of them and takes them back whole. Their arrays have the types of the simulator, so
that what was read and is written again keeps its bits.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

Colours = NDArray[np.floating[Any]]
"""(n, 4) red, green, blue and opacity, 0 to 1."""


@dataclass(frozen=True, eq=False)
class CameraView:
    """Pose and field of view of a camera."""

    IN_ROWS: ClassVar[bool] = False  # True for values with a row for each thing, taken back row by row
    position_m: NDArray[np.float64]
    """(3,) in the frame of the body that carries the camera, the world for a fixed one."""
    quaternion_wxyz: NDArray[np.float64]
    """(4,) in that frame; the camera looks along its own -z, with y up in its picture."""
    fovy_deg: float
    """Vertical field of view."""


@dataclass(frozen=True, eq=False)
class Lights:
    """The lamps of a scene, one row each; the first one is the main lamp."""

    IN_ROWS: ClassVar[bool] = True
    ambient: NDArray[np.floating[Any]]
    """(n, 3) intensity of red, green and blue."""
    diffuse: NDArray[np.floating[Any]]
    """(n, 3) likewise."""
    specular: NDArray[np.floating[Any]]
    """(n, 3) likewise."""
    direction: NDArray[np.floating[Any]]
    """(n, 3) away from the lamp, world frame."""
    casts_shadow: NDArray[Any]
    """(n,) true for lamps that cast shadows."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Colours of everything that can be seen, and the textures on it.

    A part is the smallest thing with a colour of its own, in MuJoCo a geom. A simulator without materials has
    none of their rows.
    """

    IN_ROWS: ClassVar[bool] = True
    parts: Colours
    """(n, 4) colour of each part."""
    material_of: NDArray[np.integer[Any]]
    """(n,) number of the material of each part; -1 for none."""
    materials: Colours
    """(m, 4) colour of each material."""
    textures: NDArray[np.integer[Any]]
    """(m,) number of the texture that gives a material its colours; -1 for none."""


Scenery = TypeVar("Scenery", CameraView, Lights, Surfaces)


def is_same(one: Scenery, other: Scenery) -> bool:
    """Return True if two values are equal, bit for bit."""
    names = (field.name for field in fields(one))
    return all(_is_same(getattr(one, name), getattr(other, name)) for name in names)


def with_former(now: Scenery, before: Scenery, after: Scenery) -> Scenery:
    """Return a value in which what changed between two others is as it was before; the rest stays."""
    former: dict[str, Any] = {}
    for name in (field.name for field in fields(now)):
        old, new = getattr(before, name), getattr(after, name)
        if not _is_same(old, new):
            former[name] = _former_rows(getattr(now, name), old, new) if now.IN_ROWS else old
    return replace(now, **former)


def _is_same(one: Any, other: Any) -> bool:
    return np.asarray(one).tobytes() == np.asarray(other).tobytes()


def _former_rows(now: NDArray[Any], old: NDArray[Any], new: NDArray[Any]) -> NDArray[Any]:
    rows, changed = now.copy(), (old != new).reshape(len(old), -1).any(axis=1)
    rows[changed] = old[changed]
    return rows
