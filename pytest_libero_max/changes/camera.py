"""Changes of a camera: where it stands, where it looks, how wide it sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import ManifestFields, Vector3, number, strength_of, text, vector3
from pytest_libero_max.errors import ChangeError, did_you_mean
from pytest_libero_max.worlds.contract import World

FOVY_RANGE_DEG = (5.0, 150.0)
"""Vertical field of view a shifted camera may have."""


@dataclass(frozen=True)
class ShiftCamera(ManifestFields):
    """Move a camera, turn it about the vertical axis and change its field of view.

    A component that is zero is not written at all, so a shift by nothing leaves the camera bit-identical.

    Attributes:
        camera: Camera name, for example ``agentview``.
        delta_position_m: Added to the camera's position; in the frame of the body that carries it, which
            is the world for LIBERO's fixed cameras.
        yaw_degrees: Turn about the z axis of that frame, counter-clockwise seen from above.
        delta_fovy_degrees: Added to the vertical field of view, which must stay within 5 to 150.
        calibration: How the parameters were chosen; a note.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "shift_camera"

    camera: str
    delta_position_m: Vector3
    yaw_degrees: float
    delta_fovy_degrees: float
    calibration: str | None = None

    def __post_init__(self) -> None:
        self._set("camera", text("shift_camera.camera", self.camera))
        self._set("delta_position_m", vector3("shift_camera.delta_position_m", self.delta_position_m))
        self._set("yaw_degrees", number("shift_camera.yaw_degrees", self.yaw_degrees))
        self._set("delta_fovy_degrees", number("shift_camera.delta_fovy_degrees", self.delta_fovy_degrees))
        if self.calibration is not None:
            text("shift_camera.calibration", self.calibration)

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({f"camera:{self.camera}"})

    def apply(self, world: World) -> Evidence:
        index = camera_index(world, self.operation, self.camera)
        model = world.model
        before = measure_camera(world, index)
        fovy = float(model.cam_fovy[index]) + self.delta_fovy_degrees
        if self.delta_fovy_degrees and not FOVY_RANGE_DEG[0] <= fovy <= FOVY_RANGE_DEG[1]:
            raise ChangeError(
                f"shift_camera.delta_fovy_degrees={self.delta_fovy_degrees!r} would give camera "
                f"{self.camera!r} a field of view of {fovy:g} degrees, but it must be within "
                f"{FOVY_RANGE_DEG[0]:g} to {FOVY_RANGE_DEG[1]:g}. Use a smaller delta."
            )
        if any(self.delta_position_m):
            world.alter("cam_pos", index, model.cam_pos[index] + self.delta_position_m)
        if self.yaw_degrees:
            world.alter("cam_quat", index, _turned(model.cam_quat[index], self.yaw_degrees))
        if self.delta_fovy_degrees:
            world.alter("cam_fovy", index, fovy)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, measure_camera(world, index))

    def scaled(self, strength: float) -> ShiftCamera:
        """The shift with position, yaw and field-of-view deltas multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        if s == 1.0:
            return self
        x, y, z = self.delta_position_m
        return replace(
            self,
            delta_position_m=(x * s, y * s, z * s),
            yaw_degrees=self.yaw_degrees * s,
            delta_fovy_degrees=self.delta_fovy_degrees * s,
        )


def camera_index(world: World, operation: str, camera: str) -> int:
    """The model's number of a camera.

    Raises:
        ChangeError: The scene has none of that name.
    """
    try:
        return int(world.model.camera(camera).id)
    except KeyError:
        known = [world.model.camera(i).name for i in range(world.model.ncam)]
        raise ChangeError(
            f"{operation}.camera={camera!r}, but the scene has no such camera. {did_you_mean(camera, known)}"
        ) from None


def _turned(quaternion: Sequence[float], yaw_degrees: float) -> list[float]:
    """``Rz(yaw) * quaternion`` (wxyz), normalised."""
    half = math.radians(yaw_degrees) / 2
    c, s = math.cos(half), math.sin(half)
    w, x, y, z = (float(item) for item in quaternion)
    turned = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
    norm = math.sqrt(sum(item * item for item in turned))
    return [item / norm for item in turned]


def measure_camera(world: World, index: int) -> dict[str, Any]:
    """Where a camera is, for the evidence."""
    model = world.model
    return {
        "camera_position_m": [float(value) for value in model.cam_pos[index]],
        "camera_quaternion_wxyz": [float(value) for value in model.cam_quat[index]],
        "camera_fovy_deg": float(model.cam_fovy[index]),
    }
