"""Which geoms may show in a part of an image, so that the others need not be drawn.

A geom is drawn triangle by triangle, each by itself, so leaving one out changes no pixel where all of it lies
beside the image or behind something opaque. Decisions are made for boxes around geoms and around
pieces of large meshes, and with margins far above what a processor or a GPU rounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds.contract import Array

_MARGIN_M = 1e-3
_MARGIN_PX = 1.0
_SCREEN_M = 0.2
"""Half the length of a side from which on the face of a box may hide others, as that of a table does."""

_MANY_TRIANGLES = 2000
_PIECE_M, _PIECES_ALONG = 0.06, 12
"""Least side of a piece of a mesh, about, and the most pieces along it."""

_MESH = 7
"""``mjGEOM_MESH``."""

_EVERYWHERE_M = 1e6
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_CORNERS.setflags(write=False)
_SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
_SQUARE.setflags(write=False)


@dataclass(frozen=True)
class Camera:
    """A camera with perspective and the size of its image."""

    eye: Array
    """(3,) m, world."""
    axes: Array
    """(3, 3) rows: to the right, up, forward; of unit length."""
    pixels: Array
    """(3, 3) from coordinates along these axes to column and row, multiplied by the distance forward, and
    that distance. Rows count from the bottom."""
    near_m: float
    """Distance of the nearest thing that is shown, m."""
    size: tuple[int, int]
    """Width and height of the image, pixels."""

    @classmethod
    def of(cls, camera: Any, height: int, width: int) -> Camera | None:
        """Return MuJoCo's ``MjvGLCamera`` for an image; None for one without perspective."""
        if camera.orthographic:
            return None
        forward, up = np.array(camera.forward, np.float64), np.array(camera.up, np.float64)
        near, bottom, top = camera.frustum_near, camera.frustum_bottom, camera.frustum_top
        half = camera.frustum_width or 0.5 * width / height * (top - bottom)
        across, upward = width / (2 * half), height / (top - bottom)
        left = camera.frustum_center - half
        pixels = [(near * across, 0, -left * across), (0, near * upward, -bottom * upward), (0, 0, 1)]
        axes = np.stack([np.cross(forward, up), up, forward])
        return cls(np.array(camera.pos, np.float64), axes, np.array(pixels), near, (width, height))

    @property
    def image(self) -> Part:
        """All of the image."""
        return Part((_SQUARE + 1) / 2 * self.size)

    def seen(self, points: Array) -> tuple[Array, Array]:
        """Return column and row of points, (..., 2), and their distance forward, (...) m.

        Points nearer than :attr:`near_m` count as points at that distance.
        """
        local = (points - self.eye) @ (self.pixels @ self.axes).T
        depths: Array = local[..., 2]
        return local[..., :2] / np.maximum(depths, self.near_m)[..., None], depths

    def rays(self, places: Array) -> Array:
        """Return directions, 1 m forward, (..., 3), through columns and rows (..., 2)."""
        homogeneous = np.concatenate([places, np.ones_like(places[..., :1])], axis=-1)
        rays: Array = homogeneous @ (np.linalg.inv(self.pixels).T @ self.axes)
        return rays


@dataclass(frozen=True)
class Part:
    """A convex part of an image."""

    corners: Array
    """(n, 2) columns and rows, pixels, in order."""

    def sides(self, margin_px: float) -> Array:
        """Return (k, 3) lines; a square of that half width around each point of the part is inside of all."""
        ends = np.roll(self.corners, -1, axis=0)
        along = ends - self.corners
        area = np.sum(self.corners[:, 0] * ends[:, 1] - self.corners[:, 1] * ends[:, 0])
        inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) * (1 if area > 0 else -1)
        inwards = np.concatenate([inwards, [(1, 0), (-1, 0), (0, 1), (0, -1)]])
        offsets = margin_px * np.abs(inwards).sum(axis=1) - (self.corners @ inwards.T).min(axis=0)
        return np.concatenate([inwards, offsets[:, None]], axis=1)

    def rectangle(self, size: tuple[int, int]) -> tuple[int, int, int, int]:
        """Return left, bottom, right and top of the pixels of an image around the part and a margin."""
        low, high = self.corners.min(axis=0) - 2 * _MARGIN_PX, self.corners.max(axis=0) + 2 * _MARGIN_PX
        left, bottom = np.clip(np.floor(low), 0, size).astype(int).tolist()
        right, top = np.clip(np.ceil(high), 0, size).astype(int).tolist()
        return left, bottom, right, top

    def pixels(self, rectangle: tuple[int, int, int, int]) -> NDArray[np.bool_]:
        """Return for each pixel of a rectangle whether it is in the part or its margin, (rows, columns)."""
        left, bottom, right, top = rectangle
        columns, rows = np.arange(left, right) + 0.5, np.arange(bottom, top) + 0.5
        inside = [a * columns + b * rows[:, None] + c >= 0 for a, b, c in self.sides(2 * _MARGIN_PX)]
        covered: NDArray[np.bool_] = np.logical_and.reduce(inside)
        return covered

    def grown(self) -> Array:
        """Return the corners of squares around the corners: the part and twice its margin are among them."""
        grown: Array = (self.corners[:, None] + 3 * _MARGIN_PX * _SQUARE).reshape(-1, 2)
        return grown


@dataclass(frozen=True)
class Boxes:
    """Boxes around geoms; around a plane, which has no end, one that is everywhere."""

    centres: Array
    """(n, 3) m, world."""
    rotations: Array
    """(n, 3, 3) columns: the axes of each box, world."""
    half_m: Array
    """(n, 3) Half the length of the sides, m."""

    @classmethod
    def of(cls, model: Any, data: Any, geoms: NDArray[np.intp]) -> Boxes:
        """Return the boxes of some geoms of a model, whose places are up to date."""
        rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
        boxes, bounded = model.geom_aabb[geoms], model.geom_rbound[geoms, None] > 0
        offsets = (rotations @ np.where(bounded, boxes[:, :3], 0.0)[..., None])[..., 0]
        half_m = np.where(bounded, boxes[:, 3:], _EVERYWHERE_M)
        return cls(data.geom_xpos[geoms] + offsets, rotations, half_m)

    @property
    def corners(self) -> Array:
        """(n, 8, 3) m, world."""
        reach = (_CORNERS * self.half_m[:, None]) @ self.rotations.swapaxes(1, 2)
        corners: Array = self.centres[:, None] + reach
        return corners

    @property
    def wide(self) -> NDArray[np.bool_]:
        """True for each box with a side that is large enough to hide others, (n,)."""
        wide: NDArray[np.bool_] = np.sort(self.half_m, axis=1)[:, 1] >= _SCREEN_M
        return wide

    def chosen(self, which: NDArray[Any]) -> Boxes:
        """Return some of the boxes."""
        return Boxes(self.centres[which], self.rotations[which], self.half_m[which])

    def mirrored(self, mirror: Mirror) -> Boxes:
        """Return the boxes where they appear in a mirror."""
        normal = mirror.axes[:, 2]
        flip = np.eye(3) - 2 * np.outer(normal, normal)
        centres = mirror.centre + (self.centres - mirror.centre) @ flip
        return Boxes(centres, flip @ self.rotations, self.half_m)

    def may_be_in(self, part: Part, camera: Camera) -> NDArray[np.bool_]:
        """Return for each box whether some of it may be in a part of the image, (n,)."""
        distances, reach = self._sides(part, camera)
        visible: NDArray[np.bool_] = np.logical_and.reduce(distances > -reach - _MARGIN_M, axis=1)
        return visible

    def cross(self, part: Part, camera: Camera) -> NDArray[np.bool_]:
        """Return for each box whether a side of a part of the image goes through it, (n,)."""
        distances, reach = self._sides(part, camera)
        crossing: NDArray[np.bool_] = np.logical_or.reduce(np.abs(distances) < reach, axis=1)
        return crossing

    def _sides(self, part: Part, camera: Camera) -> tuple[Array, Array]:
        """Return how boxes lie to k planes through the sides of a part of the image, inwards.

        These are the distances of the centres and the reach of the boxes, (n, k) m.
        """
        sides = np.concatenate([part.sides(3 * _MARGIN_PX), camera.image.sides(_MARGIN_PX)])
        normals = sides @ camera.pixels @ camera.axes
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + np.finfo(np.float64).tiny
        normals = np.concatenate([normals, camera.axes[2:]])
        nearest = np.zeros(len(normals))
        nearest[-1] = camera.near_m
        reach = (np.abs(normals @ self.rotations) @ self.half_m[..., None])[..., 0]
        distances = (self.centres - camera.eye) @ normals.T - nearest
        return distances, reach

    def hidden_by(self, screens: Boxes, part: Part, camera: Camera) -> NDArray[np.bool_]:
        """Return for each box whether a side of another one hides all of it that is in a part of the image.

        One does if it fills either the part or the rectangle of the image around the box, and is nearer
        there. The distance of a plane is largest at a corner.
        """
        places, depths = camera.seen(self.corners)
        nearest = depths.min(axis=1)
        hidden = np.zeros(len(nearest), np.bool_)
        low, high = places.min(axis=1) - _MARGIN_PX, places.max(axis=1) + _MARGIN_PX
        low, high = np.clip(low, 0, camera.size), np.clip(high, 0, camera.size)
        rectangles = np.where(_SQUARE[:, None] > 0, high, low)  # (4, n, 2)
        rays = (camera.rays(rectangles), camera.rays(part.grown())[:, None])
        candidates = nearest > camera.near_m
        before = screens.chosen(camera.seen(screens.corners)[1].min(axis=1) < nearest.max(initial=0.0))
        for centre, axes, half in zip(before.centres, before.rotations, before.half_m, strict=True):
            eye = (camera.eye - centre) @ axes
            for axis in np.flatnonzero(np.abs(eye) > half + _MARGIN_M).tolist():
                if half[axis - 1] < _SCREEN_M or half[axis - 2] < _SCREEN_M:
                    continue
                for directions in rays:
                    reached = _depth(eye, directions @ axes, axis, half)
                    hidden |= candidates & (reached + _MARGIN_M < nearest)
        return hidden


@dataclass(frozen=True)
class Pieces:
    """Boxes that cover the meshes of many triangles, each of them the boxes of its pieces."""

    geoms: NDArray[np.intp]
    """(n,) the geom that each piece is of."""
    centres: Array
    """(n, 3) m, in the frame of the geom."""
    half_m: Array
    """(n, 3) half the length of the sides, m."""

    @classmethod
    def of(cls, model: Any) -> Pieces:
        """Return the pieces of a model's meshes."""
        meshes = np.flatnonzero(model.geom_type == _MESH)
        geoms = meshes[model.mesh_facenum[model.geom_dataid[meshes]] >= _MANY_TRIANGLES]
        covers = [_covered(model, model.geom_dataid[geom]) for geom in geoms]
        low, high = np.concatenate([np.empty((0, 2, 3)), *covers]).swapaxes(0, 1)
        owners = np.repeat(geoms, [len(boxes) for boxes in covers])
        return cls(owners, (low + high) / 2, (high - low) / 2)

    def placed(self, which: NDArray[Any], data: Any) -> Boxes:
        """Return some of the boxes where their geoms are, which is up to date."""
        geoms = self.geoms[which]
        rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
        offsets = (rotations @ self.centres[which, :, None])[..., 0]
        return Boxes(data.geom_xpos[geoms] + offsets, rotations, self.half_m[which])


_boxes: dict[bytes, Array] = {}


def _covered(model: Any, mesh: int) -> Array:
    """Return the lowest and the highest corner of boxes that cover a mesh, (n, 2, 3) m, in its frame."""
    vertices, faces = (
        values[first[mesh] : first[mesh] + count[mesh]]
        for values, first, count in (
            (model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum),
            (model.mesh_face, model.mesh_faceadr, model.mesh_facenum),
        )
    )
    key = blake2b(vertices.tobytes() + faces.tobytes(), digest_size=16).digest()
    if key not in _boxes:
        _boxes[key] = _cover(vertices[faces].astype(np.float64))
    return _boxes[key]


def _cover(triangles: Array) -> Array:
    """Return the lowest and the highest corner of boxes that cover triangles (n, 3, 3), (k, 2, 3) m.

    Long triangles are cut into quarters, so that each box is small.
    """
    side = max(_PIECE_M, np.ptp(triangles, axis=(0, 1)).max() / _PIECES_ALONG)
    parts = [triangles]
    while (long := np.ptp(parts[-1], axis=1).max(axis=1) > side).any():
        a, b, c = parts[-1][long].swapaxes(0, 1)
        parts[-1] = parts[-1][~long]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        parts.append(np.concatenate([np.stack(quarter, axis=1) for quarter in quarters]))
    small = np.concatenate(parts)
    cells = np.floor(small.mean(axis=1) / side).astype(np.int64)
    _, which = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(which, kind="stable")
    firsts = np.flatnonzero(np.diff(which[order], prepend=-1))
    low = np.minimum.reduceat(small.min(axis=1)[order], firsts)
    high = np.maximum.reduceat(small.max(axis=1)[order], firsts)
    return np.stack([low, high], axis=1)


def _depth(eye: Array, rays: Array, axis: int, half_m: Array) -> Array:
    """Return the distance forward at which the last of k rays, (k, n, 3), meets a face of a box, (n,).

    It is infinite where one of them misses, or meets the face less than a margin from its edge.

    Args:
        eye: (3,) m, in the frame of the box, as the rays are.
        rays: Directions, 1 m forward.
        axis: Axis of the box that goes out of the face, of the two on the eye's side.
        half_m: (3,) half the length of the sides, m.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = (np.copysign(half_m[axis], eye[axis]) - eye[axis]) / rays[..., axis]
        hit = depths > 0
        for across in (axis - 1, axis - 2):
            hit &= np.abs(eye[across] + depths * rays[..., across]) < half_m[across] - _MARGIN_M
    farthest: Array = np.where(hit, depths, np.inf).max(axis=0)
    return farthest


@dataclass(frozen=True)
class Mirror:
    """The face of a box that reflects: MuJoCo reflects in the side of its third axis."""

    centre: Array
    """(3,) m, world."""
    axes: Array
    """(3, 3) columns: along the face, along the face, out of it."""
    half_m: Array
    """(2,) half the length of its sides, m."""

    @classmethod
    def of(cls, position: Array, rotation: Array, size: Array) -> Mirror:
        """Return the mirror of a box: centre (3,) m, rotation (9,), half sides (3,) m."""
        axes = rotation.reshape(3, 3)
        return cls(position + size[2] * axes[:, 2], axes, size[:2])

    def faces(self, eye: Array) -> bool:
        """Return True unless a point is behind the mirror."""
        return bool((eye - self.centre) @ self.axes[:, 2] > -_MARGIN_M)

    def part(self, camera: Camera) -> Part | None:
        """Return the part of an image that it fills; None where some of it is too near to be shown."""
        corners = self.centre + (_SQUARE * self.half_m) @ self.axes[:, :2].T
        places, depths = camera.seen(corners)
        return Part(places) if depths.min() > camera.near_m else None
