"""The algebra of changes: small frozen values that alter a world, whenever they are applied."""

from __future__ import annotations

from pytest_libero_max.changes.base import Change, Evidence, Factor
from pytest_libero_max.changes.camera import ShiftCamera
from pytest_libero_max.changes.light import SetLighting
from pytest_libero_max.changes.material import SetVisualTheme
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.pixels import Brightness, SensorCorruption, SetSensorCorruption
from pytest_libero_max.changes.poses import (
    InsertDistractors,
    InsertObstacle,
    MoveObject,
    Placement,
    RemoveObject,
)
from pytest_libero_max.changes.registry import OPERATIONS, change_from_dict, check_changes

__all__ = [
    "OPERATIONS",
    "Brightness",
    "Change",
    "Evidence",
    "Factor",
    "InsertDistractors",
    "InsertObstacle",
    "MoveObject",
    "Nothing",
    "Placement",
    "RemoveObject",
    "SensorCorruption",
    "SetLighting",
    "SetSensorCorruption",
    "SetVisualTheme",
    "ShiftCamera",
    "change_from_dict",
    "check_changes",
]
