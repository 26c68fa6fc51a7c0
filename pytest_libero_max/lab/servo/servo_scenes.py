"""Knowledge of ``servo`` before it sees anything, as of a policy that was trained on demonstrations.

The cameras and heights of two rooms, the sizes of the objects, and where a bowl stands by an instruction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pytest_libero_max.lab.servo.sight import Area, NominalCamera, Shape

CAMERA, IMAGE_SIZE = "agentview", 256


@dataclass(frozen=True)
class SceneKnowledge:
    """Properties that all tasks of a suite share."""

    camera: NominalCamera
    destination: str
    """Category of the destination."""
    destination_area: Area
    """Area in which to look for it."""
    drop: bool
    """True if the object is let go above the destination's rim, not on it."""
    clearance: float
    """Height above which nothing stands, m."""


SCENES: Mapping[str, SceneKnowledge] = MappingProxyType(
    {
        "libero_object": SceneKnowledge(
            NominalCamera((0.896577, 0.0, 0.65), (0.618217, 0.343231, 0.343231, 0.618217), 45.0, IMAGE_SIZE),
            "basket",
            Area((-0.2, 0.0), (0.2, 0.4), 0.004),
            True,
            0.15,
        ),
        "libero_spatial": SceneKnowledge(
            NominalCamera(
                (0.658613, 0.0, 1.61035), (0.638018, 0.304850, 0.304850, 0.638018), 45.0, IMAGE_SIZE
            ),
            "plate",
            Area((-0.2, -0.1), (0.3, 0.4), 0.9),
            False,
            0.96,
        ),
    }
)

FLOOR_AREA = Area((-0.35, -0.4), (0.3, 0.4), 0.0)
"""Area in which to look for groceries."""

BOWL = "akita_black_bowl"

BOWL_PLACES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "between the plate and the ramekin": (-0.06, 0.20, 0.9),
        "next to the ramekin": (-0.18, 0.32, 0.9),
        "table center": (-0.08, 0.0, 0.9),
        "on the cookie box": (0.07, 0.03, 0.919),
        "drawer": (0.10, -0.13, 1.062),
        "on the ramekin": (-0.20, 0.20, 0.936),
        "next to the cookie box": (0.13, -0.07, 0.9),
        "on the stove": (-0.26, -0.14, 0.925),
        "next to the plate": (0.01, 0.31, 0.9),
        "on the wooden cabinet": (0.02, -0.29, 1.128),
    }
)
"""Usual place of the bowl in unmodified scenes, m, world, by the words of an instruction."""

GRIP_ANGLES_RAD: Mapping[str, float] = MappingProxyType({"drawer": math.radians(30)})
"""Horizontal direction from a bowl's middle to where its rim is held, where there is no room along y."""

BOWL_REACH_M = 0.08
"""Distance from there within which to look for it."""


def _box(x: float, y: float, height: float) -> Shape:
    return Shape(((x / 2, y / 2, 0.0), (x / 2, y / 2, height)))


def _tin(radius: float, height: float) -> Shape:
    return Shape(((radius, radius, 0.0), (radius, radius, height)), rounded=True)


def _bottle(x: float, y: float, height: float, shoulder: float, cap: float) -> Shape:
    """Return a bottle; ``shoulder`` as a part of its height, ``cap`` is the width of the cap, m."""
    body = (x / 2, y / 2)
    neck = (cap / 2, cap / 2)
    return Shape(((*body, 0.0), (*body, shoulder * height), (*neck, 0.84 * height), (*neck, height)))


SHAPES: Mapping[str, Shape] = MappingProxyType(
    {
        "alphabet_soup": _tin(0.0313, 0.0762),
        "bbq_sauce": _bottle(0.0291, 0.0470, 0.1071, 0.66, 0.022),
        "butter": _box(0.0762, 0.0395, 0.0174),
        "chocolate_pudding": _box(0.0802, 0.0463, 0.0274),
        "cream_cheese": _box(0.0812, 0.0427, 0.0179),
        "ketchup": _bottle(0.0368, 0.0562, 0.1456, 0.62, 0.026),
        "milk": _box(0.0525, 0.0531, 0.1312),
        "orange_juice": _box(0.0525, 0.0531, 0.1312),
        "salad_dressing": _bottle(0.0355, 0.0527, 0.1456, 0.58, 0.024),
        "tomato_sauce": _tin(0.0311, 0.0762),
        "basket": Shape(((0.070, 0.0765, 0.0), (0.0787, 0.0848, 0.1411))),
        "plate": Shape(((0.043, 0.043, 0.0), (0.0687, 0.0687, 0.0189)), rounded=True),
        BOWL: Shape(((0.029, 0.029, 0.0), (0.049, 0.049, 0.021), (0.0535, 0.0535, 0.0505)), rounded=True),
    }
)
"""Sizes by category."""

GROCERIES = tuple(sorted(set(SHAPES) - {"basket", "plate", BOWL}))
"""Objects that instructions of LIBERO-Object ask for."""
