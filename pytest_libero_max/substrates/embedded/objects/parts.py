"""The parts of a scene object, and how they are written as MJCF.

An object is *designed upright*: in metres, in world axes as it stands at reset (front towards
``agentview``, +x; z up), with the origin where LIBERO has the body's origin. Its body frame may be turned
against that (LIBERO's bottles have y up); ``Category.upright`` is that turn, and every shape is turned back
by it when the MJCF is written. Sites are given in the body frame.

Collision shapes are in geom group 0 and visual meshes in group 1, as in robosuite, which draws group 1 only.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, reduce
from operator import add
from types import MappingProxyType
from typing import Literal

import numpy as np

from pytest_libero_max.substrates.embedded.meshes import Mesh, box, join
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import IDENTITY, Quaternion

Vector = tuple[float, float, float]
Colour = tuple[float, float, float]

# LIBERO's contact parameters: stiff, and rough enough for parallel fingers.
_CONTACT = MappingProxyType(
    {"friction": "0.95 0.3 0.1", "solref": "0.001 1", "solimp": "0.998 0.998 0.001", "condim": "3"}
)


@dataclass(frozen=True)
class Solid:
    """A box that collides: centre, half sizes and orientation."""

    pos: Vector
    half: Vector
    quat: Quaternion = IDENTITY

    @property
    def volume(self) -> float:
        """Volume in m^3."""
        return 8 * self.half[0] * self.half[1] * self.half[2]


@dataclass(frozen=True)
class Skin:
    """A mesh that is seen."""

    mesh: Mesh
    colour: Colour = (1.0, 1.0, 1.0)
    """RGB 0 to 1; multiplies the texture."""
    texture: str | None = None
    """Key of ``Category.textures``, or None."""
    shine: float = 0.2
    """Specular reflection 0 to 1."""


@dataclass(frozen=True)
class Site:
    """A named place, in the frame of its body: LIBERO's regions of objects and fixtures."""

    name: str
    pos: Vector
    half: Vector
    quat: Quaternion = IDENTITY


@dataclass(frozen=True)
class Joint:
    """A drawer's slide or a knob's hinge through the body's origin."""

    name: str
    kind: Literal["slide", "hinge"]
    axis: Vector
    range: tuple[float, float]
    damping: float


@dataclass(frozen=True)
class JointState:
    """Condition for open, closed, on or off: a joint position strictly between two bounds."""

    low: float | None = None
    """Lower bound, m or rad; None for none."""
    high: float | None = None
    """Upper bound; None for none."""
    every: bool = False
    """True if all joints of a fixture must comply (close, turn off); otherwise one is enough."""
    closed: bool = False
    """True if the bounds themselves count."""
    start: tuple[float, float] | None = None
    """Range from which a scene that begins in this state draws the position."""


@dataclass(frozen=True)
class Grip:
    """A part of a link that is made for two fingers, in the frame in which the object is designed."""

    name: str
    """For example ``handle``; ``<instance>_<name>`` is unique in a scene."""
    pos: Vector
    """Middle of the part, m."""
    along: Vector
    """Unit vector along the part; fingers close across it. Of a round part, one of many."""
    out: Vector
    """Unit vector at right angles to it and away from the object, against which the hand approaches."""
    width: float
    """Distance of the fingers when they hold it, m."""


@dataclass(frozen=True)
class Link:
    """One rigid body: of a fixture, or an object as a whole."""

    name: str
    mass: float
    solids: Sequence[Solid] = ()
    skins: Sequence[Skin] = ()
    sites: Sequence[Site] = ()
    joint: Joint | None = None
    links: Sequence[Link] = ()
    pos: Vector = (0.0, 0.0, 0.0)
    grips: Sequence[Grip] = ()


@dataclass(frozen=True)
class Category:
    """A kind of object that scenes can contain any number of times."""

    name: str
    """LIBERO's category."""
    root: Link
    """Root body, ``<instance>_<root.name>``."""
    fixture: bool = False
    """True if it is bolted to the scene instead of free."""
    upright: Quaternion = IDENTITY
    """Orientation of the body at reset."""
    origin_height: float = 0.0
    """Height of the body's origin above the surface it stands on, m."""
    spread_margin: float = 0.025
    """LIBERO's ``horizontal_radius``, by which the placement interval of a region shrinks, m."""
    textures: Mapping[str, Callable[[], Image]] = field(default_factory=dict)
    """Pictures of the skins by key, drawn when a scene is built."""
    states: Mapping[str, JointState] = field(default_factory=dict)
    """Joint positions for ``open``, ``close``, ``turnon`` and ``turnoff``."""
    lift: float = 0.0
    """Height that LIBERO adds to the origin of a fixture beyond that of a cabinet, m."""
    turn: tuple[float, float] | None = None
    """Range of the angle about z by which LIBERO turns it at reset, rad."""


def assets(category: Category) -> tuple[list[ET.Element], dict[str, Image]]:
    """Meshes, materials and textures that every instance of a category shares.

    Returns:
        The ``<asset>`` children and the picture of each texture, by texture name.
    """
    elements: list[ET.Element] = []
    pictures: dict[str, Image] = {}
    for key, draw in category.textures.items():
        picture = drawn(draw)
        name = f"{category.name}_{key}"
        pictures[name] = picture
        elements.append(texture_element(name, picture))
    back = rotations.matrix(rotations.inverse(category.upright))
    for link in links(category.root):
        for number, skin in enumerate(link.skins):
            name = _skin_name(category, link, number)
            elements.append(mesh_element(name, skin.mesh.moved(turn=back)))
            material = {"name": name, "rgba": _numbers((*skin.colour, 1.0)), "specular": f"{skin.shine:g}"}
            material["shininess"] = "0.4"
            if skin.texture is not None:
                material["texture"] = f"{category.name}_{skin.texture}"
            elements.append(ET.Element("material", material))
    return elements, pictures


def body(category: Category, instance: str, pos: Sequence[float], quat: Quaternion) -> ET.Element:
    """Return the ``<body>`` of one instance at a world pose; free to move unless it is a fixture."""
    root = _body(category, category.root, instance)
    root.set("pos", _numbers(pos))
    root.set("quat", _numbers(quat))
    if not category.fixture:
        joint = ET.Element("joint", {"name": f"{instance}_joint0", "type": "free", "damping": "0.0005"})
        root.insert(0, joint)
    return root


@cache
def drawn(draw: Callable[[], Image]) -> Image:
    """Return the picture that a function draws, drawn once per process and read-only from then on."""
    picture = draw()
    picture.setflags(write=False)
    return picture


def texture_element(name: str, picture: Image) -> ET.Element:
    """Return a texture of the right size; the picture itself is written into the compiled model."""
    height, width, _ = picture.shape
    attributes = {"name": name, "type": "2d", "builtin": "flat", "width": str(width), "height": str(height)}
    return ET.Element("texture", {**attributes, "rgb1": "1 1 1"})


def mesh_element(name: str, mesh: Mesh) -> ET.Element:
    """Return a mesh asset with its data inline."""
    return ET.Element(
        "mesh",
        {
            "name": name,
            # A visual mesh need not be closed; its volume is never used.
            "inertia": "shell",
            "vertex": _numbers(mesh.vertices.ravel()),
            "normal": _numbers(mesh.normals.ravel()),
            "texcoord": _numbers(mesh.texcoords.ravel()),
            "face": " ".join(map(str, mesh.triangles.ravel().tolist())),
        },
    )


def skin_geom(name: str, pos: Sequence[float] = (0.0, 0.0, 0.0)) -> ET.Element:
    """Return the visual geom of a mesh and a material that share a name."""
    attributes = {"type": "mesh", "mesh": name, "material": name, "pos": _numbers(pos)}
    return ET.Element("geom", {**attributes, "group": "1", "contype": "0", "conaffinity": "0", "mass": "0"})


def site_element(
    name: str, pos: Sequence[float], half: Sequence[float], quat: Quaternion = IDENTITY
) -> ET.Element:
    """Return an invisible box site."""
    attributes = {
        "name": name,
        "type": "box",
        "pos": _numbers(pos),
        "size": _numbers(half),
        "quat": _numbers(quat),
    }
    return ET.Element("site", {**attributes, "rgba": "0 0 0 0", "group": "3"})


def slab(low: Vector, high: Vector) -> Solid:
    """Return the box between two opposite corners."""
    centre = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))
    half = tuple((b - a) / 2 for a, b in zip(low, high, strict=True))
    return Solid(centre, half)  # type: ignore[arg-type]


def slab_mesh(solids: Sequence[Solid], tile: float) -> Mesh:
    """Look of slabs: every face shows the texture at the same scale, ``tile`` metres for one copy."""
    return join(
        *(
            box(solid.half, atlas=False, tile=tile).moved(solid.pos, turn=_rotation(solid.quat))
            for solid in solids
        )
    )


def _rotation(quat: Quaternion) -> np.ndarray | None:
    return None if quat == IDENTITY else rotations.matrix(quat)


def wall_ring(
    count: int, foot: tuple[float, float], rim: tuple[float, float], thickness: float
) -> tuple[Solid, ...]:
    """Return a round wall as a ring of slabs.

    Args:
        count: Slabs; a multiple of four puts one square to each horizontal axis, where fingers close.
        foot: Outer (radius, z) of the lower edge, m.
        rim: Outer (radius, z) of the upper edge, m.
        thickness: Of the slabs, inwards, m.
    """
    rise, run = rim[1] - foot[1], rim[0] - foot[0]
    slant = math.atan2(run, rise)
    length = math.hypot(rise, run)
    half_width = max(foot[0], rim[0]) * math.tan(math.pi / count)
    radius = (foot[0] + rim[0]) / 2 - thickness / 2 * math.cos(slant)
    height = (foot[1] + rim[1]) / 2 + thickness / 2 * math.sin(slant)
    slabs = []
    for k in range(count):
        angle = 2 * math.pi * k / count
        turn = rotations.multiply(rotations.about((0, 0, 1), angle), rotations.about((0, 1, 0), slant))
        centre = (radius * math.cos(angle), radius * math.sin(angle), height)
        slabs.append(Solid(centre, (thickness / 2, half_width, length / 2), turn))
    return tuple(slabs)


def _body(category: Category, link: Link, instance: str) -> ET.Element:
    element = ET.Element("body", {"name": f"{instance}_{link.name}", "pos": _numbers(link.pos)})
    if link.joint is not None:
        joint = link.joint
        attributes = {"name": f"{instance}_{joint.name}", "type": joint.kind, "axis": _numbers(joint.axis)}
        attributes |= {"range": _numbers(joint.range), "limited": "true", "damping": f"{joint.damping:g}"}
        element.append(ET.Element("joint", attributes))
    back = rotations.inverse(category.upright)
    volume = reduce(add, (solid.volume for solid in link.solids), 0.0)  # sum is another from Python 3.12 on
    for number, solid in enumerate(link.solids):
        attributes = {
            "name": f"{instance}_{link.name}_solid{number}",
            "type": "box",
            "pos": _numbers(rotations.matrix(back) @ np.asarray(solid.pos)),
            "quat": _numbers(rotations.multiply(back, solid.quat)),
            "size": _numbers(solid.half),
            "mass": f"{link.mass * solid.volume / volume:.9g}",
            "group": "0",
            "rgba": "0.6 0.6 0.6 0.4",
        }
        element.append(ET.Element("geom", {**attributes, **_CONTACT}))
    for number, _ in enumerate(link.skins):
        geom = skin_geom(_skin_name(category, link, number))
        geom.set("name", f"{instance}_{link.name}_skin{number}")
        element.append(geom)
    for site in link.sites:
        element.append(site_element(f"{instance}_{site.name}", site.pos, site.half, site.quat))
    for child in link.links:
        element.append(_body(category, child, instance))
    return element


def links(link: Link) -> list[Link]:
    """Return a link and everything attached to it, depth first."""
    return [link, *(deeper for child in link.links for deeper in links(child))]


def _skin_name(category: Category, link: Link, number: int) -> str:
    return f"{category.name}_{link.name}_skin{number}"


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return " ".join([f"{value:.7g}" for value in plain])
