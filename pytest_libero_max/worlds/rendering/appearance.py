"""Appearance of a world: whether it looks as it did, and where things stood that an event moved away."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import AlterableWorld, Image, OnMujoco, PixelFilter, World

STILL_M = 5e-4
"""Way of a geom up to which a world is not drawn again: a fifth of a pixel in a picture of 256 pixels."""
_STILL_TURN = 2e-3
"""Change of a rotation matrix up to which it is not either: a tenth of a degree."""
MOVED_M = 5e-3
"""Way of a thing in an event from which on its old place is shown."""

_CUBE = np.array(np.meshgrid((-1, 1), (-1, 1), (-1, 1))).reshape(3, -1).T
"""(8, 3) corners of a cube around its middle, which is two wide."""
_CUBE.flags.writeable = False

Points = NDArray[np.float64]
"""(n, 3) m, world frame: corners of a thing."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """All that decides what a world looks like."""

    positions: NDArray[np.float64]
    """(n, 3) m, of its geoms."""
    rotations: NDArray[np.float64]
    """(n, 9), of its geoms."""
    model: Mapping[str, NDArray[Any]]
    """Lights, colours, cameras and all else that a change can alter, by name."""
    filters: tuple[tuple[PixelFilter, int], ...]

    def is_like(self, other: Appearance) -> bool:
        """Return True if a picture would show no difference. With pixel filters (noise?), never."""
        return (
            not self.filters
            and not other.filters
            and bool(np.abs(self.positions - other.positions).max() < STILL_M)
            and bool(np.abs(self.rotations - other.rotations).max() < _STILL_TURN)
            and all(np.array_equal(value, other.model[name]) for name, value in self.model.items())
        )


def appearance(world: World) -> Appearance | None:
    """Return what a world looks like now; None where that cannot be told without drawing it."""
    if not isinstance(world, OnMujoco):
        return None
    state, data = world.snapshot(), world.data
    return Appearance(data.geom_xpos.copy(), data.geom_xmat.copy(), state.model, state.filters)


def places_of(world: World) -> dict[str, Points]:
    """Return the corners of everything in a world, by entity.

    Without MuJoCo they are those of a cube, as far from a thing's origin as its farthest point.
    """
    if not isinstance(world, OnMujoco | AlterableWorld):
        return {}
    parked = set(world.parked)
    return {name: _corners(world, name) for name in world.entities if name not in parked}


def left(before: Mapping[str, Points], world: World) -> list[Points]:
    """Return the places of things that are not there any more.

    Args:
        before: What :func:`places_of` returned.
    """
    now = places_of(world)
    return [
        corners
        for name, corners in before.items()
        if len(corners) and (name not in now or np.abs(now[name] - corners).max() > MOVED_M)
    ]


def outlines(
    places: Iterable[Points], world: World, images: Mapping[str, Image]
) -> dict[str, list[NDArray[np.int32]]]:
    """Return where places are in the pictures of a world, by camera; each (n, 2) pixels.

    Args:
        images: Upright pictures of its cameras. Pictures of another name are left out, and without MuJoCo
            those of all but the main camera, which moves with nothing.
    """
    import cv2

    hulls: dict[str, list[NDArray[np.int32]]] = {}
    if not isinstance(world, OnMujoco | AlterableWorld):
        return hulls
    cameras = world.cameras if isinstance(world, OnMujoco) else world.robot.cameras[:1]
    for place in places:
        for camera in cameras:
            seen = _seen(world, camera, place, images[camera].shape) if camera in images else None
            if seen is not None:
                hulls.setdefault(camera, []).append(cv2.convexHull(seen)[:, 0].astype(np.int32))
    return hulls


def pose_of_camera(
    world: OnMujoco | AlterableWorld, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return position (3,) m and (3, 3) rotation of a camera, and its vertical angle of view in rad.

    The rotation is from its own frame (x right, y up, looking along -z) to the world's. Without MuJoCo a
    camera is taken to stand in the world, as the main one does.
    """
    if not isinstance(world, OnMujoco):
        view = world.view(name)
        turn = rotations.matrix(rotations.quaternion(view.quaternion_wxyz))
        return view.position_m, turn, math.radians(view.fovy_deg)
    number = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_CAMERA, name)
    data = world.data
    angle = float(np.deg2rad(world.model.cam_fovy[number]))
    return np.array(data.cam_xpos[number]), np.array(data.cam_xmat[number]).reshape(3, 3), angle


def _seen(
    world: OnMujoco | AlterableWorld, camera: str, place: Points, shape: Sequence[int]
) -> NDArray[np.float32] | None:
    """Return the pixels of points, (n, 2); None where one of them is behind the camera."""
    position, rotation, angle = pose_of_camera(world, camera)
    x, y, z = ((place - position) @ rotation).T
    if z.max() > -1e-2:
        return None
    height, width = shape[:2]
    focal = 0.5 * height / np.tan(0.5 * angle)
    pixels = np.stack([width / 2 - focal * x / z, height / 2 + focal * y / z], axis=1)
    return pixels.clip(-4 * height, 4 * height).astype(np.float32)


def _corners(world: OnMujoco | AlterableWorld, entity: str) -> Points:
    """Return the vertices of an entity's meshes and the corners of its other geoms."""
    if not isinstance(world, OnMujoco):
        return world.position(entity) + world.radius_m(entity) / math.sqrt(3.0) * _CUBE
    model, data = world.model, world.data
    corners = []
    for geom in world.geoms(entity):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            own = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)
        else:
            centre, half = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
            own = centre + half * _CUBE
        corners.append(own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate(corners) if corners else np.zeros((0, 3))
