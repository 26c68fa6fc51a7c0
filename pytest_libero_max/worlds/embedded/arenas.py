"""The rooms: a wooden table in a tiled room, and that room's bare floor; each with its cameras and lights."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.embedded import textures
from pytest_libero_max.worlds.embedded.meshes import Mesh, box, join, panel
from pytest_libero_max.worlds.embedded.objects.base import (
    Vector,
    drawn,
    mesh_element,
    skin_geom,
    texture_element,
)
from pytest_libero_max.worlds.embedded.rotations import Quaternion


@dataclass(frozen=True)
class Arena:
    """A room.

    Attributes:
        surface: Name of the entity that things stand on.
        surface_body: Its MuJoCo body.
        surface_pos: Where that body is, m, world.
        top_z: Height of the surface, m.
        fixture_z: Height at which fixtures have their origin, m.
        mount: robosuite mount of the robot: ``rethink`` pedestal or ``ground``.
        robot_base_pos: Where the robot's base stands, m, world.
        agentview: Position and orientation (wxyz) of LIBERO's main camera.
        frontview_z: Height of the front camera, m.
    """

    surface: str
    surface_body: str
    surface_pos: Vector
    top_z: float
    fixture_z: float
    mount: str
    robot_base_pos: Vector
    agentview: tuple[Vector, Quaternion]
    frontview_z: float


ARENAS: dict[str, Arena] = {
    "tabletop": Arena(
        "main_table",
        "table",
        (0.0, 0.0, 0.875),
        0.9,
        0.905,
        "rethink",
        (-0.66, 0.0, 0.912),
        ((0.658613, 0.0, 1.610350), (0.638018, 0.304850, 0.304850, 0.638018)),
        1.48,
    ),
    "floor": Arena(
        "floor",
        "floor",
        (0.0, 0.0, 0.0),
        0.0,
        0.0,
        "ground",
        (-0.6, 0.0, 0.0),
        ((0.896577, 0.0, 0.65), (0.618217, 0.343231, 0.343231, 0.618217)),
        0.65,
    ),
}

_TABLE_HALF = (0.5, 0.6, 0.025)
_ROOM = 2.6
_WALL_HEIGHT = 3.0

# Cameras that are the same in both rooms: position, orientation (wxyz).
_CAMERAS: dict[str, tuple[Vector, Quaternion]] = {
    "birdview": ((-0.2, 0.0, 3.0), (0.707107, 0.0, 0.0, 0.707107)),
    "galleryview": ((2.844548, 2.127968, 3.128617), (0.422614, 0.233744, 0.416469, 0.770269)),
    "sideview": ((-0.056518, 1.276122, 1.487957), (0.009905, 0.006878, 0.591223, 0.806418)),
}
_FRONTVIEW: Quaternion = (0.560842, 0.430646, 0.430646, 0.560842)

# No light casts shadows, in LIBERO as here. Ambient light belongs to the lights and not to the headlight,
# so that scaling the lights scales everything that is seen.
_LIGHTS = (
    {"name": "light1", "pos": "1 1 4", "dir": "-0.42 -0.34 -0.84", "diffuse": "0.50 0.49 0.47"},
    {"name": "light2", "pos": "-3 -3 4", "dir": "0.30 0.55 -0.78", "diffuse": "0.20 0.21 0.23"},
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
        "frontview": ((1.0, 0.0, arena.frontview_z), _FRONTVIEW),
        **_CAMERAS,
    }
    for name, (pos, quat) in cameras.items():
        attributes = {
            "mode": "fixed",
            "name": name,
            "pos": _numbers(pos),
            "quat": _numbers(quat),
            "fovy": "45",
        }
        worldbody.append(ET.Element("camera", attributes))

    pictures = {"room_floor": drawn(textures.tiles), "room_wall": drawn(textures.plaster)}
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
    if kind == "floor":
        surface.append(ground)
    else:
        worldbody.append(ground)
        attributes = {"name": "table_collision", "type": "box", "size": _numbers(_TABLE_HALF)}
        surface.append(
            ET.Element("geom", {**attributes, "friction": "0.6 0.005 0.0001", "group": "0", "mass": "1"})
        )
        pictures["room_table"] = drawn(_table_top)
        _skin(assets, surface, "room_table", box(_TABLE_HALF, 0.004, atlas=False, tile=0.9), "room_table")
        _skin(assets, surface, "room_legs", _legs(), None, "0.36 0.25 0.16 1")
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


def _table_top() -> Image:
    return textures.wood(256, (136, 92, 54), (196, 150, 100), planks=6)


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
