"""Changes: frozen values that alter a world when they are applied, at reset or during an episode."""

from __future__ import annotations

from pytest_libero_max.changes.camera import OrbitCamera, PlaceCamera, ShiftCamera
from pytest_libero_max.changes.change import Change, Evidence
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import ManifestFields, Vector3, strength_of
from pytest_libero_max.changes.inputs import FreezeImages, HideInputs, SwapImages
from pytest_libero_max.changes.instruction import SetInstruction, SetTask
from pytest_libero_max.changes.light import SetLamps, SetLighting
from pytest_libero_max.changes.material import CoverEntity, SetTexture, SetVisualTheme
from pytest_libero_max.changes.nothing import DelayAnswers, Nothing
from pytest_libero_max.changes.pixels import (
    Brightness,
    CorruptPicture,
    Glare,
    PictureCorruption,
    SensorCorruption,
    SetGlare,
    SetSensorCorruption,
)
from pytest_libero_max.changes.poses import (
    BumpObject,
    InsertDistractors,
    InsertObstacle,
    MoveObject,
    Placement,
    PutObject,
    RemoveObject,
    TurnObject,
)
from pytest_libero_max.changes.registry import OPERATIONS, change_from_dict, check_changes
from pytest_libero_max.changes.reversal import Reversal
from pytest_libero_max.changes.robot import OffsetArm, OpenGripper

__all__ = [
    "OPERATIONS",
    "Brightness",
    "BumpObject",
    "Change",
    "CorruptPicture",
    "CoverEntity",
    "DelayAnswers",
    "Evidence",
    "Factor",
    "FreezeImages",
    "Glare",
    "HideInputs",
    "InsertDistractors",
    "InsertObstacle",
    "ManifestFields",
    "MoveObject",
    "Nothing",
    "OffsetArm",
    "OpenGripper",
    "OrbitCamera",
    "PictureCorruption",
    "PlaceCamera",
    "Placement",
    "PutObject",
    "RemoveObject",
    "Reversal",
    "SensorCorruption",
    "SetGlare",
    "SetInstruction",
    "SetLamps",
    "SetLighting",
    "SetSensorCorruption",
    "SetTask",
    "SetTexture",
    "SetVisualTheme",
    "ShiftCamera",
    "SwapImages",
    "TurnObject",
    "Vector3",
    "change_from_dict",
    "check_changes",
    "strength_of",
]
