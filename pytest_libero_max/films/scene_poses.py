"""The recorded poses of a pair in three dimensions: its scene once, and where everything was after each step.

Shapes and textures are what MuJoCo draws. Colours, textures and lights that an event changes are followed;
noise and other changes of the pictures alone are not to be seen in three dimensions.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.films.drawing import shared_steps
from pytest_libero_max.films.replay import Look, Tick, View, distinct_arms
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.recorded_poses import RecordedPoses, packed, part_name, quantised
from pytest_libero_max.worlds.contract import CAMERAS, CONTROL_HZ, OnMujoco, World
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.rendering.appearance import MOVED_M, pose_of_camera
from pytest_libero_max.worlds.rendering.renderer import DRAWN_GROUPS

gl.prepare()

import mujoco  # noqa: E402

VERSION = 1
"""Raised when the viewer has to read something else."""

_TEXTURE_PX = 256
"""Longest side of a texture."""
_TEXTURE_QUALITY = 80
_JUMP_M = 0.04
"""Way within one step from which a thing was moved by an event and not by the hand, which is slower."""
_MOST_VERTICES = 65_535
"""Number of vertices up to which a mesh is shown; a larger one is shown as its box."""

_SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "sphere",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
_COLOUR_ROLE = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
_PLAIN = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's colour of a geom that has none of its own, which its material then has."""

Surface = tuple[float, ...]
"""Red, green, blue, opacity (0 to 1), number of the texture (-1: none) and how often it repeats, two ways."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Posed(View):
    """Where everything in a world is, and what it looks like.

    Attributes:
        bodies: (n, 7) m and w, x, y, z of each body, world frame.
        surfaces: Of each geom; None where it is not drawn.
        light: Brightness of all lights together.
        camera: Position, rotation (rows) and vertical angle (rad) of the first camera.
        hand: (3,) m.
    """

    bodies: NDArray[np.float64]
    surfaces: tuple[Surface | None, ...]
    light: float
    camera: tuple[float, ...]
    hand: NDArray[np.float64]


def look_at_poses() -> Look:
    """Return a look that notes poses and colours, and draws nothing."""
    known: dict[bytes, tuple[tuple[Surface | None, ...], float]] = {}

    def look(name: str, step: int, world: World, before: View | None) -> View:
        assert isinstance(world, OnMujoco)
        model, data = world.model, world.data
        seen = b"".join(getattr(model, field).tobytes() for field in _LOOKS)
        if seen not in known:
            known[seen] = _surfaces(model), _brightness(model)
        surfaces, light = known[seen]
        place, turn, angle = pose_of_camera(world, CAMERAS[0])
        return Posed(
            {},
            0.0,
            bodies=np.concatenate([data.xpos, data.xquat], axis=1),
            surfaces=surfaces,
            light=light,
            camera=(*place.tolist(), *turn.ravel().tolist(), angle),
            hand=np.array(world.end_effector()),
        )

    return look


def poses_of(world: World, record: PairRecord, ticks: Iterable[Tick]) -> RecordedPoses:
    """Return a pair in three dimensions.

    Args:
        world: Of the pair; its shapes and textures are read, which nothing changes.
        record: The pair.
        ticks: All of its steps, seen with :func:`look_at_poses`.

    Returns:
        The header has ``geoms`` (number of the body, shape or name of a mesh, half sizes in m, position and
        quaternion in the body's frame), ``textures`` by number, ``surfaces``, ``bodies`` (name, and its pose
        where it never moves), ``moving`` (numbers of those that do, in the order of the poses) and ``arms``.
        An arm has ``steps``; ``from``, the step before which its poses are those of the first arm; ``looks``
        (step, and the surface of each geom from then on), ``lights`` (step, and brightness relative to the
        start), ``cameras`` (step, and the first camera), ``hand`` (positions after every step, in mm) and
        ``left`` (step, body and its pose before an event moved it away).
    """
    assert isinstance(world, OnMujoco)
    names = distinct_arms(record)
    arms: dict[str, list[Posed]] = {name: [] for name in names}
    for tick in ticks:
        for name in names:
            view = tick.views[name]
            assert isinstance(view, Posed)
            if tick.step <= record.arms[name].steps:
                arms[name].append(view)
    poses = {name: np.stack([view.bodies for view in views]) for name, views in arms.items()}
    moving = _moving(list(poses.values()))
    drawn = sorted({geom for views in arms.values() for geom in _drawn(views)})
    parts: dict[str, bytes] = {}
    surfaces: list[Surface] = []
    owners = _owners(world)
    header: Json = {
        "version": VERSION,
        "hz": CONTROL_HZ,
        "geoms": [_geom(world.model, geom, parts) for geom in drawn],
        "bodies": [
            [owners.get(body, world.model.body(body).name), None if body in moving else _rounded(first)]
            for body, first in enumerate(poses[names[0]][0])
        ],
        "moving": moving,
        "surfaces": surfaces,
    }
    shared = shared_steps(record, names)
    brightness = arms[names[0]][0].light
    moves, described = [], []
    for place, name in enumerate(names):
        views = arms[name]
        begin = min(shared, len(views) - 1) if place else 0
        moves.append(packed(quantised(_steady(poses[name][:, moving])[begin:])))
        described.append(
            {
                "name": name,
                "steps": len(views) - 1,
                "success": record.arms[name].success,
                "from": begin,
                "looks": _changes([_numbered(view.surfaces, drawn, surfaces) for view in views]),
                "lights": _changes([round(view.light / (brightness or 1.0), 3) for view in views]),
                "cameras": _changes([_rounded(view.camera) for view in views]),
                "hand": np.rint(1e3 * np.stack([view.hand for view in views])).astype(int).ravel().tolist(),
                "events": sorted({firing.step for firing in record.arms[name].firings}),
                "left": _left(record, name, names[0], poses, arms, owners, shared),
            }
        )
    header["arms"] = described
    header["textures"] = _textures(world.model, surfaces, parts)
    return RecordedPoses(header, parts, b"".join(moves))


_LOOKS = (
    "geom_rgba", "geom_matid", "geom_group", "mat_rgba", "mat_texid", "mat_texrepeat",
    "light_active", "light_ambient", "light_diffuse",
)  # fmt: skip
"""Fields of a model that an event can change and the viewer shows."""


def _surfaces(model: Any) -> tuple[Surface | None, ...]:
    """Return the surface of each geom as MuJoCo chooses it; None for one that is not drawn."""
    found: list[Surface | None] = []
    for geom in range(model.ngeom):
        rgba, material = tuple(model.geom_rgba[geom].tolist()), int(model.geom_matid[geom])
        texture, repeat = -1, (1.0, 1.0)
        if material >= 0:
            texture = int(model.mat_texid[material][_COLOUR_ROLE])
            repeat = tuple(model.mat_texrepeat[material].tolist())
            rgba = tuple(model.mat_rgba[material].tolist()) if rgba == _PLAIN else rgba
        shown = model.geom_group[geom] in DRAWN_GROUPS and rgba[3] > 0
        surface = (*(round(part, 3) for part in rgba), texture, *(round(part, 3) for part in repeat))
        found.append(surface if shown else None)
    return tuple(found)


def _brightness(model: Any) -> float:
    lamps = (model.light_ambient + model.light_diffuse).mean(axis=1) @ model.light_active.astype(float)
    head = model.vis.headlight
    return float(lamps + (np.array(head.ambient) + np.array(head.diffuse)).mean() * bool(head.active))


def _drawn(views: Sequence[Posed]) -> set[int]:
    return {
        geom
        for surfaces in {view.surfaces for view in views}
        for geom, surface in enumerate(surfaces)
        if surface
    }


def _moving(poses: Sequence[NDArray[np.float64]]) -> list[int]:
    """Return the bodies that are not at one place in all arms and steps."""
    first = poses[0][0]
    ways = np.max([np.abs(arm - first).max(axis=(0, 2)) for arm in poses], axis=0)
    return [int(body) for body in np.flatnonzero(ways > 1e-5)]


def _steady(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses whose quaternions, of which each has two signs, go on smoothly."""
    steady = poses.copy()
    along = (steady[1:, :, 3:] * steady[:-1, :, 3:]).sum(axis=2)
    steady[1:, :, 3:] *= np.cumprod(np.where(along < 0, -1, 1), axis=0)[:, :, None]
    return steady


def _owners(world: OnMujoco) -> dict[int, str]:
    """Return the entity that each body is a part of; of a fixture, its own name for those that move."""
    found: dict[int, str] = {}
    for name in world.entities:
        for geom in world.geoms(name):
            body = int(world.model.geom_bodyid[geom])
            root = int(world.model.body_rootid[body])
            own = world.model.body(body).name
            found.setdefault(
                body, name if body == root or world.model.body_dofnum[root] else f"{name}, {own}"
            )
    return found


def _changes(values: Sequence[Any]) -> list[list[Any]]:
    """Return the steps at which a value changes, with what it is from then on."""
    return [[step, value] for step, value in enumerate(values) if step == 0 or value != values[step - 1]]


def _numbered(surfaces: Sequence[Surface | None], drawn: Sequence[int], known: list[Surface]) -> list[int]:
    """Return the number of the surface of each drawn geom; -1 where it is hidden."""
    numbers = []
    for geom in drawn:
        surface = surfaces[geom]
        if surface is not None and surface not in known:
            known.append(surface)
        numbers.append(-1 if surface is None else known.index(surface))
    return numbers


def _left(
    record: PairRecord,
    name: str,
    first: str,
    poses: Mapping[str, NDArray[np.float64]],
    arms: Mapping[str, Sequence[Posed]],
    owners: Mapping[int, str],
    shared: int,
) -> list[list[Any]]:
    """Return step, body and earlier pose of what an event moved away in an arm.

    The first arm is where this one was before they part. At later events the step before tells, from which a
    thing in the hand is not far.
    """
    found = []
    for step in sorted({firing.step for firing in record.arms[name].firings}):
        apart = name != first and step == shared and step < len(poses[first])
        if not apart and step == 0:
            continue
        before = poses[first][step] if apart else poses[name][step - 1]
        ways = np.linalg.norm(poses[name][step][:, :3] - before[:, :3], axis=1)
        for body in np.flatnonzero(ways > (MOVED_M if apart else _JUMP_M)):
            if int(body) in owners:
                found.append([step, int(body), _rounded(before[body])])
    return found


def _geom(model: Any, geom: int, parts: dict[str, bytes]) -> list[Any]:
    kind = mujoco.mjtGeom(model.geom_type[geom])
    size = model.geom_size[geom].astype(float)
    place = _rounded([*model.geom_pos[geom], *model.geom_quat[geom]])
    shape = _SHAPES.get(kind, "box")
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        content = _mesh(model, int(model.geom_dataid[geom]))
        if content is not None:
            shape = part_name(content)
            parts[shape] = content
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        size = size[[0, 0, 0]]
    elif kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        size = size[[0, 0, 1]]
    elif kind == mujoco.mjtGeom.mjGEOM_PLANE:
        size = np.where(size > 0, size, 3.0)
    return [int(model.geom_bodyid[geom]), shape, _rounded(size), place]


@cache
def _mesh_of(vertices: bytes, normals: bytes, places: bytes, faces: bytes) -> bytes | None:
    """Return a mesh as the viewer reads it; the vertices have a normal and a place in the texture each."""
    points = np.frombuffer(vertices, np.float32).reshape(-1, 3)
    directions = np.frombuffer(normals, np.float32).reshape(-1, 3)
    textured = np.frombuffer(places, np.float32).reshape(-1, 2)
    corners = np.frombuffer(faces, np.int32).reshape(-1, 3)  # of vertex, normal, place
    kinds, indices = np.unique(corners, axis=0, return_inverse=True)
    if len(kinds) > _MOST_VERTICES:
        return None
    points, directions = points[kinds[:, 0]], directions[kinds[:, 1]]
    flat = textured[kinds[:, 2]] if len(textured) else np.zeros((len(kinds), 2), np.float32)
    scales = []
    whole = []
    for values in (points, flat):
        low, span = values.min(axis=0), np.ptp(values, axis=0)
        scales += [*low.tolist(), *span.tolist()]
        whole.append(np.rint((values - low) / np.where(span > 0, span, 1) * 65535).astype(np.uint16))
    return b"".join(
        [
            struct.pack("<3I", len(kinds), len(corners) // 3, bool(len(textured))),
            struct.pack("<10f", *scales),
            whole[0].tobytes(),
            whole[1].tobytes(),
            indices.astype(np.uint16).tobytes(),
            np.rint(127 * directions).astype(np.int8).tobytes(),
        ]
    )


def _mesh(model: Any, mesh: int) -> bytes | None:
    def rows(values: Any, first: int, number: int) -> NDArray[Any]:
        return np.ascontiguousarray(values[first : first + number])

    vertices = rows(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh])
    normals = rows(model.mesh_normal, model.mesh_normaladr[mesh], model.mesh_normalnum[mesh])
    first, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    corners = [rows(model.mesh_face, first, number), rows(model.mesh_facenormal, first, number)]
    places = np.zeros((0, 2), np.float32)
    if model.mesh_texcoordnum[mesh]:
        places = rows(model.mesh_texcoord, model.mesh_texcoordadr[mesh], model.mesh_texcoordnum[mesh])
        corners.append(rows(model.mesh_facetexcoord, first, number))
    else:
        corners.append(np.zeros_like(corners[0]))
    faces = np.stack(corners, axis=2).astype(np.int32)
    return _mesh_of(vertices.tobytes(), normals.tobytes(), places.tobytes(), faces.tobytes())


def _textures(model: Any, surfaces: list[Surface], parts: dict[str, bytes]) -> dict[str, str]:
    """Return the name of each texture that a surface shows, by its number. Only flat ones are shown."""
    found = {}
    for number in sorted({int(surface[4]) for surface in surfaces}):
        if number >= 0 and model.tex_type[number] == mujoco.mjtTexture.mjTEXTURE_2D:
            content = _texture(model, number)
            found[str(number)] = part_name(content)
            parts[part_name(content)] = content
    return found


def _texture(model: Any, number: int) -> bytes:
    """Return a texture as a WebP, with the first row of MuJoCo's at the top."""
    height, width, channels = (
        int(values[number]) for values in (model.tex_height, model.tex_width, model.tex_nchannel)
    )
    begin = int(model.tex_adr[number])
    pixels = model.tex_data[begin : begin + height * width * channels].reshape(height, width, channels)
    picture = Picture.fromarray(np.ascontiguousarray(pixels if channels == 3 else pixels[:, :, :3]))
    picture.thumbnail((_TEXTURE_PX, _TEXTURE_PX))
    file = io.BytesIO()
    picture.save(file, format="WEBP", quality=_TEXTURE_QUALITY, method=4)
    return file.getvalue()


def _rounded(values: Iterable[Any]) -> list[float]:
    return [round(float(value), 5) for value in values]
