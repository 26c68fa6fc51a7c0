"""A Panda that moves and collides like robosuite's and is fast to render.

Bodies, inertias, joints, actuators, collision shapes, gripper and pedestal are those of the installed
robosuite, read from its own files. Only what is drawn is replaced: 168 000 triangles of visual meshes
give way to some 3 000, which a software renderer notices. Links are drawn by the convex collision mesh
that robosuite has for each; the one of link 1, which is as fine as its visual mesh, by its outline.
"""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds.robot import GRIPPER, MOUNT, ROBOT

WHITE = "0.93 0.94 0.95 1"
GREY = "0.45 0.46 0.48 1"
DARK = "0.16 0.16 0.17 1"
_COLOURS = MappingProxyType(
    {f"{ROBOT}_link7": GREY, f"{GRIPPER}_leftfinger": DARK, f"{GRIPPER}_rightfinger": DARK}
)
_KEPT_MESHES = (f"{GRIPPER}_finger_vis",)
_FINE_MESH = f"{ROBOT}_link1"
_OUTLINE = f"{_FINE_MESH}_outline"
_OUTLINE_DIRECTIONS = 120


def add_robot(document: ET.Element, robot: ET.Element) -> None:
    """Merge robosuite's assembled robot into a scene, in front of everything else, with light visuals.

    Args:
        document: Root of a complete MJCF document; changed in place.
        robot: Root of the MJCF of robosuite's robot model, mount and gripper attached; changed in place.
    """
    _lighten(robot)
    for section in ("asset", "worldbody", "actuator", "sensor", "contact", "equality", "tendon"):
        source = robot.find(section)
        if source is None or not len(source):
            continue
        target = document.find(section)
        if target is None:
            target = ET.SubElement(document, section)
        # The robot's bodies come first, so its joints lead qpos as they do in LIBERO.
        for place, element in enumerate(list(source)):
            target.insert(place, element)


def _lighten(robot: ET.Element) -> None:
    """Replace every drawn geom by a light one and drop the assets that nothing uses any more."""
    for body in _bodies(robot):
        name = body.get("name", "")
        for site in [child for child in body if child.tag == "site"]:
            site.set("rgba", "0 0 0 0")  # robosuite hides its markers only while it resets
        for geom in [child for child in body if child.tag == "geom"]:
            if geom.get("group") == "1" and geom.get("mesh") not in _KEPT_MESHES:
                body.remove(geom)
            elif geom.get("group") != "1":
                drawn = _visual_twin(name, geom)
                if drawn is not None:
                    body.append(drawn)
            elif geom.get("mesh") in _KEPT_MESHES:
                geom.set("rgba", _COLOURS.get(name, WHITE))
    assets = robot.find("asset")
    assert assets is not None
    _add_outline(assets)
    _drop_unused(robot, assets)


def _visual_twin(body: str, collision: ET.Element) -> ET.Element | None:
    """Return a geom to draw in place of a collision geom; None for those that something else stands for."""
    mesh = collision.get("mesh", "")
    if mesh == f"{GRIPPER}_finger" or collision.get("name", "").endswith("pad_collision"):
        return None  # the fingers keep their own visual meshes
    if "feet" in collision.get("name", "") or "controller_box" in collision.get("name", ""):
        return None  # robosuite does not draw these parts of the pedestal either
    drawn = ET.Element("geom", {"contype": "0", "conaffinity": "0", "group": "1", "mass": "0"})
    for attribute in ("type", "pos", "quat", "size", "mesh"):
        value = collision.get(attribute)
        if value is not None:
            drawn.set(attribute, value)
    if mesh == _FINE_MESH:
        drawn.set("mesh", _OUTLINE)
    drawn.set("name", f"{collision.get('name', body)}_drawn")
    drawn.set("rgba", DARK if body.startswith(f"{MOUNT}_") else _COLOURS.get(body, WHITE))
    return drawn


def _add_outline(assets: ET.Element) -> None:
    fine = next(mesh for mesh in assets.iter("mesh") if mesh.get("name") == _FINE_MESH)
    ET.SubElement(assets, "mesh", {"name": _OUTLINE, "vertex": _outline_of(fine.get("file", ""))})


@cache  # every scene has the same robot
def _outline_of(file: str) -> str:
    points = outline(stl_vertices(Path(file)), _OUTLINE_DIRECTIONS)
    return " ".join(f"{value:.6g}" for value in points.ravel())


def _drop_unused(robot: ET.Element, assets: ET.Element) -> None:
    for tag in ("mesh", "material", "texture"):
        used = {element.get(tag) for element in robot.iter() if element.get(tag)}
        for element in [child for child in assets if child.tag == tag and child.get("name") not in used]:
            assets.remove(element)


def _bodies(root: ET.Element) -> Iterator[ET.Element]:
    for body in root.iter("body"):
        if body.get("name", "").startswith((f"{ROBOT}_", f"{MOUNT}_", f"{GRIPPER}_")):
            yield body


def stl_vertices(path: Path) -> NDArray[np.float64]:
    """(n, 3) corners of all triangles of a binary STL file."""
    content = path.read_bytes()
    (count,) = struct.unpack_from("<I", content, 80)
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.frombuffer(content, dtype=facet, count=count, offset=84)["corners"]
    return corners.reshape(-1, 3).astype(np.float64)


def outline(points: NDArray[np.float64], directions: int) -> NDArray[np.float64]:
    """Return the points that reach farthest in evenly spread directions: corners of a light convex hull.

    Args:
        points: (n, 3).
        directions: Number of directions, on a Fibonacci sphere.

    Returns:
        (m, 3) with m <= directions, without repetitions, in the order of the directions.
    """
    number = np.arange(directions)
    height = 1.0 - (2.0 * number + 1.0) / directions
    angle = number * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    sphere = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    farthest = np.argmax(sphere @ points.T, axis=1)
    return points[list(dict.fromkeys(farthest.tolist()))]
