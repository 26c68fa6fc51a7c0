"""Changes of a camera: shifted by a little, carried around the scene, or placed elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from pytest_libero_max.benchmark.structs import Text
from pytest_libero_max.changes.alteration import Alteration, Blended
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import (
    Cosine,
    Degrees,
    Place,
    Share,
    Vector3,
    between,
)
from pytest_libero_max.errors import ChangeError, did_you_mean
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import AlterableWorld, Array

FOVY_RANGE_DEG = (5.0, 150.0)
"""Vertical field of view a shifted camera may have."""


class _CameraChange(Alteration):
    camera: str

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({f"camera:{self.camera}"})

    def _require(self, world: AlterableWorld) -> None:
        if self.camera not in world.cameras:
            raise ChangeError.seen(
                f"{self.operation}.camera",
                self.camera,
                f", but the scene has no such camera. {did_you_mean(self.camera, world.cameras)}",
            )

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        view = world.view(self.camera)
        return {
            "camera_position_m": view.position_m.tolist(),
            "camera_quaternion_wxyz": view.quaternion_wxyz.tolist(),
            "camera_fovy_deg": view.fovy_deg,
        }


@dataclass(frozen=True)
class ShiftCamera(_CameraChange):
    """Move a camera, turn it about the vertical axis and change its field of view.

    A component that is zero is not written at all, so a shift by nothing leaves the camera bit-identical.
    """

    operation: ClassVar[str] = "shift_camera"
    magnitudes = ("delta_position_m", "yaw_degrees", "delta_fovy_degrees")

    camera: Text
    """Camera name, for example ``agentview``."""
    delta_position_m: Place
    """Added to the camera's position; in the frame of the body that carries it, which is the world for
    LIBERO's fixed cameras."""
    yaw_degrees: Annotated[float, between(-360.0, 360.0)]
    """Turn about the z axis of that frame, counter-clockwise seen from above."""
    delta_fovy_degrees: Degrees
    """Added to the vertical field of view, which must stay within 5 to 150."""
    calibration: Text | None = None
    """Rule by which the parameters were chosen; a note."""

    def _alter(self, world: AlterableWorld) -> None:
        view = world.view(self.camera)
        fovy = view.fovy_deg + self.delta_fovy_degrees
        if self.delta_fovy_degrees and not FOVY_RANGE_DEG[0] <= fovy <= FOVY_RANGE_DEG[1]:
            raise ChangeError.seen(
                "shift_camera.delta_fovy_degrees",
                self.delta_fovy_degrees,
                f" would give camera "
                f"{self.camera!r} a field of view of {fovy:g} degrees, but it must be within "
                f"{FOVY_RANGE_DEG[0]:g} to {FOVY_RANGE_DEG[1]:g}. Use a smaller delta.",
            )
        shifted: dict[str, Any] = {}
        if any(self.delta_position_m):
            shifted["position_m"] = view.position_m + self.delta_position_m
        if self.yaw_degrees:
            shifted["quaternion_wxyz"] = np.array(_yawed(view.quaternion_wxyz, self.yaw_degrees))
        if self.delta_fovy_degrees:
            shifted["fovy_deg"] = fovy
        if shifted:
            world.set_view(self.camera, replace(view, **shifted))


def _yawed(turn: Array, yaw_degrees: float) -> rotations.Quaternion:
    return rotations.unit_by_squares(rotations.yawed(rotations.quaternion(turn), yaw_degrees))


_Y, _Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class OrbitCamera(_CameraChange):
    """Move a fixed camera around a pivot (elevation, azimuth, distance), then turn it in place.

    In this order, in the world frame: elevation about the y axis through the pivot, azimuth about the z axis
    of the world, distance from the pivot, yaw about z and pitch about y without moving. A part that is zero
    (or a distance factor of 1) is left out, so an orbit by nothing leaves the camera bit-identical.
    """

    operation: ClassVar[str] = "orbit_camera"
    magnitudes = ("elevation_degrees", "azimuth_degrees", "yaw_degrees", "pitch_degrees")

    camera: Text
    """A camera that the world itself carries, for example ``agentview``."""
    pivot_m: Place
    """Point that it turns about and moves away from."""
    elevation_degrees: Degrees = 0.0
    """Upwards."""
    azimuth_degrees: Degrees = 0.0
    """Counter-clockwise seen from above."""
    distance_scale: Annotated[float, between(0.05, 20.0)] = 1.0
    """Factor on the distance from the pivot, above 0."""
    yaw_degrees: Degrees = 0.0
    """Turn on the spot, counter-clockwise seen from above."""
    pitch_degrees: Degrees = 0.0
    """Turn on the spot, downwards for a camera that looks along -x."""

    def _alter(self, world: AlterableWorld) -> None:
        view, pivot = world.view(self.camera), np.array(self.pivot_m)
        place, turn = view.position_m, rotations.quaternion(view.quaternion_wxyz)
        if self.elevation_degrees:
            tilt = rotations.about(_Y, math.radians(-self.elevation_degrees))
            place, turn = pivot + rotations.rotate(tilt, place - pivot), rotations.multiply(tilt, turn)
        if self.azimuth_degrees:
            swing = rotations.about(_Z, math.radians(self.azimuth_degrees))
            place, turn = np.array(rotations.rotate(swing, place)), rotations.multiply(swing, turn)
        if self.distance_scale != 1.0:
            place = pivot + (place - pivot) * self.distance_scale
        if self.yaw_degrees:
            turn = rotations.multiply(rotations.about(_Z, math.radians(self.yaw_degrees)), turn)
        if self.pitch_degrees:
            turn = rotations.multiply(rotations.about(_Y, math.radians(-self.pitch_degrees)), turn)
        _write(world, self.camera, place, turn)

    def _at(self, strength: float) -> OrbitCamera:
        return replace(super()._at(strength), distance_scale=1.0 + (self.distance_scale - 1.0) * strength)


@dataclass(frozen=True)
class PlaceCamera(_CameraChange, Blended):
    """Put a camera at a pose, or part of the way there."""

    operation: ClassVar[str] = "place_camera"

    camera: Text
    """Camera name."""
    position_m: Place
    """In the frame of the body that carries it, the world for LIBERO's fixed cameras."""
    quaternion_wxyz: tuple[Cosine, Cosine, Cosine, Cosine]
    """Unit quaternion in that frame."""
    blend: Share | None = None
    """Share of the way, 0 to 1; None means all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(math.hypot(*self.quaternion_wxyz) - 1.0) > 1e-3:
            raise ChangeError.seen(
                f"{self.operation}.quaternion_wxyz",
                list(self.quaternion_wxyz),
                ", but must have unit length.",
            )

    @classmethod
    def looking_at(cls, camera: str, position_m: Vector3, aim_m: Vector3) -> PlaceCamera:
        """Put a camera at a position, upright, so that ``aim_m`` is in the middle of its picture."""
        back = np.subtract(position_m, aim_m)
        back /= np.linalg.norm(back)
        right = np.array([-back[1], back[0], 0.0]) / math.hypot(back[0], back[1])
        up = np.cross(back, right)
        try:
            turn = rotations.of_axes(right, up, back)
        except ValueError:
            raise ChangeError.seen(
                "aim_m",
                aim_m,
                f" lies straight behind position_m={position_m!r}, where no single "
                "upright orientation exists. Move either of them.",
            ) from None
        return cls(camera, position_m, tuple(round(float(part), 8) for part in turn))  # type: ignore[arg-type]

    def _alter(self, world: AlterableWorld) -> None:
        if self.share:
            view = world.view(self.camera)
            place, turn = view.position_m, view.quaternion_wxyz
            goal_place, goal_turn = np.array(self.position_m), self.quaternion_wxyz
            if self.share != 1.0:
                goal_place = place + (goal_place - place) * self.share
                goal_turn = rotations.between(rotations.quaternion(turn), goal_turn, self.share)
            _write(world, self.camera, goal_place, goal_turn)


def _write(world: AlterableWorld, camera: str, place: Array, turn: rotations.Quaternion) -> None:
    view = world.view(camera)
    placed: dict[str, Any] = {}
    if not np.array_equal(place, view.position_m):
        placed["position_m"] = place
    if not np.array_equal(turn, view.quaternion_wxyz):
        placed["quaternion_wxyz"] = np.array(rotations.unit_fused(turn))
    if placed:
        world.set_view(camera, replace(view, **placed))
