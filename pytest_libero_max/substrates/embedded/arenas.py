"""The rooms: tables in a plain room, a kitchen, a living room and a study, and one bare floor.

Each has LIBERO's cameras, lights and heights; the looks are our own.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.meshes import Mesh, box, join, panel
from pytest_libero_max.substrates.embedded.objects.parts import (
    Colour,
    Solid,
    Vector,
    drawn,
    mesh_element,
    skin_geom,
    slab,
    slab_mesh,
    texture_element,
)
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import Quaternion

Pose = tuple[Vector, Quaternion]


@dataclass(frozen=True)
class Arena:
    """A room."""

    surface: str
    """Name of the entity that things stand on."""
    surface_body: str
    """Its MuJoCo body."""
    surface_pos: Vector
    """Position of that body, m, world."""
    top_z: float
    """Height of the surface, m."""
    region_z: float
    """Height of the regions' sites in the frame of that body, m."""
    fixture_z: float
    """Height at which fixtures have their origin, m."""
    mount: str
    """Robosuite mount of the robot: ``rethink`` pedestal or ``ground``."""
    robot_base_pos: Vector
    agentview: Pose
    """Position and orientation (wxyz) of LIBERO's main camera."""
    frontview: Vector
    """Position of the front camera, m."""
    paperview: Vector | None = None
    """Position of the camera that only the rooms of LIBERO-10 have, m."""
    spares_edges: bool = False
    """True if LIBERO shrinks a region by the object's nominal radius before it draws a place."""
    friction: Vector = (1.0, 0.005, 0.0001)
    """Friction of the surface: sliding, torsional, rolling."""
    solids: tuple[Solid, ...] = ()
    """Collision shapes of the table, in the frame of its body; empty for the bare floor."""
    floor: Callable[[], Image] = textures.tiles
    wall: Callable[[], Image] = textures.plaster
    top: Callable[[], Image] = textures.wood
    frame: Colour = (0.36, 0.25, 0.16)
    """Colour of the table's legs."""


_HIGH: Quaternion = (0.638018, 0.304850, 0.304850, 0.638018)
_LOW: Quaternion = (0.618217, 0.343231, 0.343231, 0.618217)


_table_top = partial(textures.wood, 256, (136, 92, 54), (196, 150, 100), planks=6)
_butcher_block = partial(textures.wood, 256, (176, 138, 92), (222, 188, 140), planks=12, seed=21)
_walnut = partial(textures.wood, 256, (92, 62, 44), (142, 102, 74), planks=3, seed=23)
_cherry = partial(textures.wood, 256, (138, 76, 50), (184, 116, 80), seed=25)
_ceramic = partial(textures.tiles, dark=(120, 124, 128), light=(152, 156, 160), seam=(92, 94, 98))
_oak_floor = partial(textures.wood, 256, (158, 116, 76), (206, 164, 116), planks=8, seed=27)
_TABLE = (Solid((0.0, 0.0, 0.0), (0.5, 0.6, 0.025)),)
# The coffee table: a long top with cut corners on a box.
_COFFEE_TABLE = (
    slab((-0.82417, -0.61932, 0.41308), (0.33873, 0.7241, 0.43676)),
    slab((-0.66675, -0.82139, 0.41308), (0.16675, -0.61932, 0.43676)),
    slab((-0.66675, 0.7241, 0.41308), (0.16675, 0.90069, 0.43676)),
    slab((-0.60, -0.35, 0.0), (0.12, 0.43, 0.41308)),
)
_DESK = (
    slab((-0.68946, -1.39273, 0.81345), (0.68946, 1.39273, 0.88513)),
    *(
        slab((x - 0.03, y - 0.05, 0.0), (x + 0.03, y + 0.05, 0.81345))
        for x in (-0.5005, 0.4962)
        for y in (-0.6907, 0.7147)
    ),
)

ARENAS: Mapping[str, Arena] = MappingProxyType(
    {
        "tabletop": Arena(
            "main_table",
            "table",
            (0.0, 0.0, 0.875),
            top_z=0.9,
            region_z=0.02,
            fixture_z=0.905,
            mount="rethink",
            robot_base_pos=(-0.66, 0.0, 0.912),
            agentview=((0.658613, 0.0, 1.610350), _HIGH),
            frontview=(1.0, 0.0, 1.48),
            spares_edges=True,
            friction=(0.6, 0.005, 0.0001),
            solids=_TABLE,
            top=_table_top,
        ),
        "floor": Arena(
            "floor",
            "floor",
            (0.0, 0.0, 0.0),
            top_z=0.0,
            region_z=0.02,
            fixture_z=0.0,
            mount="ground",
            robot_base_pos=(-0.6, 0.0, 0.0),
            agentview=((0.896577, 0.0, 0.65), _LOW),
            frontview=(1.0, 0.0, 0.65),
            spares_edges=True,
        ),
        "kitchen": Arena(
            "kitchen_table",
            "table",
            (0.0, 0.0, 0.875),
            top_z=0.9,
            region_z=0.0,
            fixture_z=0.905,
            mount="rethink",
            robot_base_pos=(-0.66, 0.0, 0.912),
            agentview=((0.658613, 0.0, 1.610350), _HIGH),
            frontview=(1.0, 0.0, 1.48),
            paperview=(2.1, 0.535, 2.075),
            solids=_TABLE,
            floor=_ceramic,
            wall=textures.linen,
            top=_butcher_block,
            frame=(0.30, 0.24, 0.18),
        ),
        "living_room": Arena(
            "living_room_table",
            "living_room_table",
            (0.0, 0.0, 0.0),
            top_z=0.43676,
            region_z=0.41,
            fixture_z=0.441,
            mount="ground",
            robot_base_pos=(-0.51, 0.0, 0.42),
            agentview=((0.606577, 0.0, 0.96), _LOW),
            frontview=(1.5, 0.0, 0.9),
            paperview=(2.1, 0.735, 1.875),
            friction=(0.95, 0.3, 0.1),
            solids=_COFFEE_TABLE,
            floor=_oak_floor,
            top=_walnut,
            frame=(0.24, 0.17, 0.12),
        ),
        "study": Arena(
            "study_table",
            "study_table",
            (0.0, 0.0, 0.0),
            top_z=0.88513,
            region_z=0.867,
            fixture_z=0.872,
            mount="rethink",
            robot_base_pos=(-0.75, 0.0, 0.912),
            agentview=((0.458613, 0.0, 1.610350), _HIGH),
            frontview=(1.0, 0.0, 1.48),
            paperview=(2.1, 0.535, 2.075),
            friction=(0.95, 0.3, 0.1),
            solids=_DESK,
            top=_cherry,
            frame=(0.30, 0.17, 0.11),
        ),
    }
)

_ROOM = 2.6
_WALL_HEIGHT = 3.0

# Cameras that are the same in every room: position, orientation (wxyz).
_CAMERAS: Mapping[str, Pose] = MappingProxyType(
    {
        "birdview": ((-0.2, 0.0, 3.0), (0.707107, 0.0, 0.0, 0.707107)),
        "galleryview": ((2.844548, 2.127968, 3.128617), (0.422614, 0.233744, 0.416469, 0.770269)),
        "sideview": ((-0.056518, 1.276122, 1.487957), (0.009905, 0.006878, 0.591223, 0.806418)),
    }
)
_FRONTVIEW: Quaternion = (0.560842, 0.430646, 0.430646, 0.560842)
_PAPERVIEW: Quaternion = (0.512987, 0.352991, 0.442988, 0.644983)

# No light casts shadows, in LIBERO as here. Ambient light belongs to the lights and not to the headlight,
# so that scaling the lights scales everything that is seen.
_LIGHTS = (
    MappingProxyType(
        {"name": "light1", "pos": "1 1 4", "dir": "-0.42 -0.34 -0.84", "diffuse": "0.50 0.49 0.47"}
    ),
    MappingProxyType(
        {"name": "light2", "pos": "-3 -3 4", "dir": "0.30 0.55 -0.78", "diffuse": "0.20 0.21 0.23"}
    ),
)


def furnish(kind: str, assets: ET.Element, worldbody: ET.Element) -> tuple[dict[str, Image], ET.Element]:
    """Write a room into an MJCF document.

    Returns:
        Its textures by name, and the element of the body that things stand on.
    """
    arena = ARENAS[kind]
    for light in _LIGHTS:
        common = {
            "ambient": "0.22 0.22 0.22",
            "specular": "0.12 0.12 0.12",
            "directional": "true",
            "castshadow": "false",
        }
        worldbody.append(ET.Element("light", {**light, **common}))
    cameras = {
        "agentview": arena.agentview,
        "frontview": (arena.frontview, _FRONTVIEW),
        **_CAMERAS,
    }
    if arena.paperview is not None:
        cameras["paperview"] = (arena.paperview, _PAPERVIEW)
    for name, (pos, quat) in cameras.items():
        attributes = {
            "mode": "fixed",
            "name": name,
            "pos": _numbers(pos),
            "quat": _numbers(quat),
            "fovy": "45",
        }
        worldbody.append(ET.Element("camera", attributes))

    pictures = {"room_floor": drawn(arena.floor), "room_wall": drawn(arena.wall)}
    _skin(assets, worldbody, "room_floor", _ground(), "room_floor")
    _skin(assets, worldbody, "room_wall", _walls(), "room_wall")
    ground = ET.Element(
        "geom",
        {
            "name": "floor",
            "type": "plane",
            "size": "3 3 0.125",
            "friction": "1 0.005 0.0001",
            "group": "0",
            "rgba": "0.5 0.5 0.5 1",
        },
    )
    surface = ET.SubElement(
        worldbody, "body", {"name": arena.surface_body, "pos": _numbers(arena.surface_pos)}
    )
    if not arena.solids:
        surface.append(ground)
    else:
        worldbody.append(ground)
        _table(arena, assets, surface)
        pictures["room_table"] = drawn(arena.top)
    for name, picture in pictures.items():
        assets.append(texture_element(name, picture))
    return pictures, surface


def _skin(
    assets: ET.Element, parent: ET.Element, name: str, mesh: Mesh, texture: str | None, rgba: str = "1 1 1 1"
) -> None:
    assets.append(mesh_element(name, mesh))
    material = {"name": name, "rgba": rgba, "specular": "0.1", "shininess": "0.2"}
    assets.append(ET.Element("material", material if texture is None else {**material, "texture": texture}))
    geom = skin_geom(name)
    geom.set("name", f"{name}_visual")
    parent.append(geom)


def _table(arena: Arena, assets: ET.Element, surface: ET.Element) -> None:
    """Add the collision solids of a table, its top (textured) and its legs (plain)."""
    for number, solid in enumerate(arena.solids):
        attributes = {
            "name": "table_collision" if number == 0 else f"table_collision{number}",
            "type": "box",
            "size": _numbers(solid.half),
        }
        if any(solid.pos):
            attributes["pos"] = _numbers(solid.pos)
        attributes |= {"friction": _numbers(arena.friction), "group": "0", "mass": "1"}
        surface.append(ET.Element("geom", attributes))
    top, legs = _TABLE_LOOKS[arena.surface]()
    _skin(assets, surface, "room_table", top, "room_table")
    _skin(assets, surface, "room_legs", legs, None, _numbers((*arena.frame, 1.0)))


def _plain_table() -> tuple[Mesh, Mesh]:
    return box(_TABLE[0].half, 0.004, atlas=False, tile=0.9), _legs()


def _coffee_table() -> tuple[Mesh, Mesh]:
    """Return a top with cut corners over a box."""
    (x0, y0, z0), (x1, y1, z1) = (-0.82417, -0.82139, 0.41308), (0.33873, 0.90069, 0.43676)
    (cut_x0, cut_x1), (cut_y0, cut_y1) = (-0.66675, 0.16675), (-0.61932, 0.7241)
    outline = [
        (cut_x0, y0),
        (cut_x1, y0),
        (x1, cut_y0),
        (x1, cut_y1),
        (cut_x1, y1),
        (cut_x0, y1),
        (x0, cut_y1),
        (x0, cut_y0),
    ]
    # The grain runs along the table, which is y.
    parts = [panel([(x, y, z1) for x, y in outline], [(y / 0.9, x / 0.9) for x, y in outline])]
    for (ax, ay), (bx, by) in zip(outline, [*outline[1:], outline[0]], strict=True):
        length = math.hypot(bx - ax, by - ay)
        corners = [(ax, ay, z0), (bx, by, z0), (bx, by, z1), (ax, ay, z1)]
        parts.append(panel(corners, [(0, 0), (length / 0.9, 0), (length / 0.9, 0.03), (0, 0.03)]))
    return join(*parts), slab_mesh(_COFFEE_TABLE[3:], 0.9)


def _desk() -> tuple[Mesh, Mesh]:
    top = _DESK[0]
    return box(top.half, 0.006, atlas=False, tile=0.9).moved(top.pos), slab_mesh(_DESK[1:], 0.9)


_TABLE_LOOKS = MappingProxyType(
    {
        "main_table": _plain_table,
        "kitchen_table": _plain_table,
        "living_room_table": _coffee_table,
        "study_table": _desk,
    }
)


def _ground() -> Mesh:
    r, repeats = 3.0, 7.5
    corners = [(-r, -r, 0.0), (r, -r, 0.0), (r, r, 0.0), (-r, r, 0.0)]
    return panel(corners, [(0, 0), (repeats, 0), (repeats, repeats), (0, repeats)])


def _walls() -> Mesh:
    r, h, u, v = _ROOM, _WALL_HEIGHT, 4.0, 2.0
    uv = [(0, 0), (u, 0), (u, v), (0, v)]
    return join(
        panel([(-r, -r, 0), (-r, r, 0), (-r, r, h), (-r, -r, h)], uv),
        panel([(r, -r, 0), (-r, -r, 0), (-r, -r, h), (r, -r, h)], uv),
        panel([(-r, r, 0), (r, r, 0), (r, r, h), (-r, r, h)], uv),
    )


def _legs() -> Mesh:
    half = (0.03, 0.03, 0.425)
    return join(
        *(
            box(half, atlas=False).moved((x, y, -0.025 - half[2]))
            for x in (-0.45, 0.45)
            for y in (-0.55, 0.55)
        )
    )


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.7g}" for v in values)
