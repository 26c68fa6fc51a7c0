"""Procedural visual meshes: surfaces of revolution, boxes with chamfered edges, bent tubes, flat panels.

Every mesh carries its own normals and texture coordinates, one of each for every vertex, so that sharp
edges and label seams are plain: where something changes abruptly, the vertex exists twice. Lengths are in
metres, the frame is the one in which an object is designed (see :mod:`.objects.parts`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from types import MappingProxyType

import numpy as np

from pytest_libero_max.worlds.contract import Array

Point = Sequence[float]

FACES = ("front", "back", "top", "right", "left", "bottom")
"""Faces of a box as seen by ``agentview``: front looks along +x, right along +y, top along +z."""

_ATLAS_COLUMNS, _ATLAS_ROWS = 3, 2

# For each face of a box: outward normal, the direction in which its picture's right side points, and its up.
_FACE_AXES: Mapping[str, tuple[Point, Point, Point]] = MappingProxyType(
    {
        "front": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        "back": ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
        "top": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        "right": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
        "left": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        "bottom": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    }
)


@dataclass(frozen=True)
class Mesh:
    """Triangles for the renderer."""

    vertices: Array
    """(V, 3) m."""
    normals: Array
    """(V, 3) unit vectors."""
    texcoords: Array
    """(V, 2), u to the right and v up, both 0 to 1 over one copy of the texture."""
    triangles: np.ndarray
    """(T, 3) vertex indices, counter-clockwise seen from outside."""

    def moved(
        self, offset: Point = (0.0, 0.0, 0.0), scale: Point = (1.0, 1.0, 1.0), turn: Array | None = None
    ) -> Mesh:
        """Return a copy, scaled along the axes, turned by a (3, 3) rotation, then shifted by ``offset``."""
        rotation = np.eye(3) if turn is None else turn
        normals = self.normals / np.asarray(scale)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Mesh(
            (self.vertices * np.asarray(scale)) @ rotation.T + np.asarray(offset),
            normals @ rotation.T,
            self.texcoords,
            self.triangles,
        )


def join(*meshes: Mesh) -> Mesh:
    """One mesh out of several that share a material."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.texcoords for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def panel(corners: Sequence[Point], texcoords: Sequence[Point] = ((0, 0), (1, 0), (1, 1), (0, 1))) -> Mesh:
    """Return a flat convex polygon, its corners counter-clockwise as seen from its visible side."""
    vertices = np.asarray(corners, dtype=np.float64)
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    normal /= _length(normal)
    count = len(vertices)
    triangles = np.array([(0, k, k + 1) for k in range(1, count - 1)])
    uv = np.asarray(texcoords, dtype=np.float64)[:count]
    return Mesh(vertices, np.tile(normal, (count, 1)), uv, triangles)


def face_axes(face: str) -> tuple[Array, Array, Array]:
    """Outward normal, picture-right and picture-up of a box face, each (3,)."""
    normal, right, up = _FACE_AXES[face]
    return np.asarray(normal, float), np.asarray(right, float), np.asarray(up, float)


def atlas_cell(face: str) -> tuple[float, float, float, float]:
    """Place of a face's picture in a box atlas: (u0, v0, u1, v1), v up."""
    number = FACES.index(face)
    column, row = number % _ATLAS_COLUMNS, number // _ATLAS_COLUMNS
    return (
        column / _ATLAS_COLUMNS,
        1 - (row + 1) / _ATLAS_ROWS,
        (column + 1) / _ATLAS_COLUMNS,
        1 - row / _ATLAS_ROWS,
    )


def box(half: Point, chamfer: float = 0.0, atlas: bool = True, tile: float | None = None) -> Mesh:
    """Return a box around the origin whose twelve edges are cut off by ``chamfer`` metres.

    Args:
        half: Half sizes in m.
        chamfer: Width of the cut edges in m; shading makes them look round.
        atlas: True if the texture is a box atlas (six pictures); otherwise each face shows the whole texture.
        tile: Edge length in m that one copy of the texture covers, instead of the whole face.
    """
    h = np.asarray(half, float)
    parts: list[Mesh] = []
    rims: dict[str, tuple[Array, Array]] = {}
    for face in FACES:
        normal, right, up = face_axes(face)
        inner = np.abs(h) - chamfer
        extent_r, extent_u = abs(right @ inner), abs(up @ inner)
        centre = normal * abs(normal @ h)
        corners = np.array([centre + a * right * extent_r + b * up * extent_u for a, b in _CORNERS])
        if atlas:
            u0, v0, u1, v1 = atlas_cell(face)
            uv = np.array([(u0 if a < 0 else u1, v0 if b < 0 else v1) for a, b in _CORNERS])
            # Half a texel inwards, so that filtering does not bleed the neighbour's picture over the edge.
            uv += (np.array([(u0 + u1) / 2, (v0 + v1) / 2]) - uv) * 0.01
        else:
            reach_u = 1.0 if tile is None else 2 * extent_r / tile
            reach_v = 1.0 if tile is None else 2 * extent_u / tile
            uv = np.array([(0 if a < 0 else reach_u, 0 if b < 0 else reach_v) for a, b in _CORNERS])
        rims[face] = (corners, uv)
        parts.append(panel([tuple(c) for c in corners], [tuple(t) for t in uv]))
    if chamfer > 0.0:
        parts.extend(_bevels(rims))
    return join(*parts)


_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def _bevels(rims: dict[str, tuple[Array, Array]]) -> list[Mesh]:
    """Return the cut edges and corners of a box, each vertex shaded like the face it touches."""
    points: list[Array] = []
    uvs: list[Array] = []
    owners: list[str] = []
    for face, (corners, uv) in rims.items():
        for corner, coordinate in zip(corners, uv, strict=True):
            points.append(corner)
            uvs.append(coordinate)
            owners.append(face)
    octants: dict[tuple[int, ...], list[int]] = {}
    for number, point in enumerate(points):
        octants.setdefault(tuple(int(v) for v in np.sign(point)), []).append(number)
    polygons = list(octants.values())
    for first, second in combinations(FACES, 2):
        first_normal, second_normal = face_axes(first)[0], face_axes(second)[0]
        if first_normal @ second_normal == 0:
            near = [
                n
                for n, p in enumerate(points)
                if owners[n] in (first, second) and p @ first_normal > 0 and p @ second_normal > 0
            ]
            polygons.append(near)
    meshes = []
    for polygon in polygons:
        corners = np.array([points[n] for n in polygon])
        middle = corners.mean(axis=0)
        outward = sum((face_axes(owners[n])[0] for n in polygon), np.zeros(3))
        order = _around(corners - middle, outward)
        meshes.append(
            Mesh(
                corners[order],
                np.array([face_axes(owners[polygon[k]])[0] for k in order]),
                np.array([uvs[polygon[k]] for k in order]),
                np.array([(0, k, k + 1) for k in range(1, len(order) - 1)]),
            )
        )
    return meshes


def _around(spokes: Array, axis: Array) -> list[int]:
    """Return indices of ``spokes`` in counter-clockwise order seen against ``axis``."""
    axis = axis / _length(axis)
    first = spokes[0] - axis * (spokes[0] @ axis)
    first /= _length(first)
    second = np.cross(axis, first)
    angles = np.arctan2(spokes @ second, spokes @ first)
    return [int(k) for k in np.argsort(angles, kind="stable")]


def revolve(profile: Sequence[tuple[float, float]], segments: int = 24, crease_deg: float = 35.0) -> Mesh:
    """Turn a profile around the z axis.

    u runs once around, starting at the back (-x) so that a label's middle faces the camera; v follows the
    profile's length from its first point (0) to its last (1).

    Args:
        profile: (radius, z) in m, ordered so that the outside lies to the right of the direction of travel:
        for a
            solid, from the bottom of the axis outwards and up to the top of the axis.
    """
    points = np.asarray(profile, float)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    outward = np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths[:, None]
    limit = math.cos(math.radians(crease_deg))
    rings: list[tuple[Array, Array, float]] = []
    spans: list[tuple[int, int]] = []
    for k in range(len(steps)):
        smooth_start = k > 0 and outward[k - 1] @ outward[k] > limit
        if smooth_start:
            start = len(rings) - 1
        else:
            rings.append((points[k], outward[k], along[k]))
            start = len(rings) - 1
        smooth_end = k + 1 < len(steps) and outward[k] @ outward[k + 1] > limit
        normal = outward[k] + outward[k + 1] if smooth_end else outward[k]
        rings.append((points[k + 1], normal / _length(normal), along[k + 1]))
        spans.append((start, len(rings) - 1))
    angles = np.pi + 2 * np.pi * np.arange(segments + 1) / segments
    cos, sin = np.cos(angles), np.sin(angles)
    vertices, normals, texcoords = [], [], []
    for (radius, z), (normal_r, normal_z), v in rings:
        vertices.append(np.stack([radius * cos, radius * sin, np.full_like(cos, z)], axis=1))
        normals.append(np.stack([normal_r * cos, normal_r * sin, np.full_like(cos, normal_z)], axis=1))
        texcoords.append(np.stack([np.arange(segments + 1) / segments, np.full_like(cos, v)], axis=1))
    width = segments + 1
    triangles = []
    for lower, upper in spans:
        for s in range(segments):
            a, b = lower * width + s, lower * width + s + 1
            c, d = upper * width + s + 1, upper * width + s
            if rings[lower][0][0] > 0:
                triangles.append((a, b, c))
            if rings[upper][0][0] > 0:
                triangles.append((a, c, d))
    return Mesh(
        np.concatenate(vertices), np.concatenate(normals), np.concatenate(texcoords), np.array(triangles)
    )


def tube(path: Sequence[Point], half_width: float, half_depth: float, segments: int = 8) -> Mesh:
    """Return a bent rod with an elliptic cross-section and closed ends.

    Args:
        path: Points (x, y, z) in m, all in one plane that contains the z axis, none straight above each other
            twice in a row.
        half_width: Half axis of the cross-section across that plane, m.
        half_depth: Half axis of the cross-section in that plane, m.
    """
    points = np.asarray(path, float)
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    spread = points[:, :2] - points[0, :2]
    far = spread[np.argmax(np.linalg.norm(spread, axis=1))]
    across = np.array([-far[1], far[0], 0.0]) / _length(far)
    within = np.cross(across, tangents)
    angles = 2 * np.pi * np.arange(segments + 1) / segments
    cos, sin = np.cos(angles)[None, :, None], np.sin(angles)[None, :, None]
    rings = (
        points[:, None]
        + half_depth * cos * within[:, None]
        + half_width * sin * np.broadcast_to(across, (1, 1, 3))
    )
    normals = half_width * cos * within[:, None] + half_depth * sin * across
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    count, width = len(points), segments + 1
    u, v = np.meshgrid(np.arange(width) / segments, np.arange(count) / (count - 1))
    triangles = []
    for ring in range(count - 1):
        for s in range(segments):
            a, b = ring * width + s, ring * width + s + 1
            triangles += [(a, b, b + width), (a, b + width, a + width)]
    side = Mesh(
        rings.reshape(-1, 3),
        normals.reshape(-1, 3),
        np.stack([u, v], axis=2).reshape(-1, 2),
        np.array(triangles),
    )
    blank = [(0.0, 0.0)] * segments
    lids = [panel(rings[0, :-1][::-1].tolist(), blank), panel(rings[-1, :-1].tolist(), blank)]
    return join(side, *lids)


def _length(vector: Array) -> float:
    """Return the length of a vector, its squares added one by one.

    NumPy leaves it to BLAS, whose last bit differs from one kind of processor to the next.
    """
    squares = 0.0
    for value in vector.tolist():
        squares += value * value
    return math.sqrt(squares)


def faceted(mesh: Mesh) -> Mesh:
    """Return the same surface with every triangle shaded flat."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        mesh.texcoords[mesh.triangles].reshape(-1, 2),
        np.arange(3 * len(corners)).reshape(-1, 3),
    )
