"""The hands of the arms, as far as the expert's routes depend on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pytest_libero_max.lab.robosuite.robots import SAWYER, UR5E
from pytest_libero_max.lab.robosuite.world import TaskWorld
from pytest_libero_max.worlds.robot import GRIPPER, PANDA


@dataclass(frozen=True)
class HandShape:
    """A hand that points down."""

    neutral_rad: float
    """Horizontal direction of the axis of its fingers in the middle of the wrist's range."""
    tip_m: float
    """Distance of its fingertips below the grip site."""
    palm_m: float
    """Distance of its palm above the grip site."""
    pads: tuple[str, str]
    """Geoms of the pads of its fingers."""
    open_m: float
    """Distance between the middles of the pads from which it counts as open."""


def _pads(first: str, second: str) -> tuple[str, str]:
    return f"{GRIPPER}_{first}", f"{GRIPPER}_{second}"


_UP = math.pi / 2
_SHAPES = MappingProxyType(
    {
        PANDA.name: HandShape(
            _UP, 0.012, 0.026, _pads("finger1_pad_collision", "finger2_pad_collision"), 0.07
        ),
        UR5E.name: HandShape(
            _UP, 0.009, 0.05, _pads("left_fingerpad_collision", "right_fingerpad_collision"), 0.07
        ),
        SAWYER.name: HandShape(_UP, 0.014, 0.04, _pads("l_fingerpad_g0", "r_fingerpad_g0"), 0.06),
    }
)


def shape_of(robot: str) -> HandShape:
    """Return the hand of an arm."""
    return _SHAPES[robot]


def is_open(world: TaskWorld) -> bool:
    """Return True if the fingers of a world's hand are open."""
    shape = shape_of(world.arm.name)
    first, second = (world.data.geom(pad).xpos for pad in shape.pads)
    return bool(np.linalg.norm(first - second) > shape.open_m)
