"""The handles of drawers and doors and the knobs of a genuine scene, and what some objects are held by.

The package does not say what its models are held by, so it is read off their collision boxes: a drawer has
its handle foremost in the direction in which it opens, a door in the direction away from its fixture, and a
knob has its bar on top. Objects whose bounding box is no help (a pot or a mug with its handle) have their
parts in a table, measured on the same boxes.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.privileged import GraspablePart
from pytest_libero_max.worlds.rendering import gl

gl.prepare()

import mujoco  # noqa: E402

_UP, _X, _Y = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

_Grip = tuple[str, tuple[float, float, float], tuple[float, float, float], tuple[float, float, float], float]

_MOKA_POT: tuple[_Grip, ...] = (
    ("handle", (0.0, 0.0725, 0.028), _UP, _Y, 0.013),
    ("handle_top", (0.0, 0.0583, 0.060), _Y, _UP, 0.013),
    ("knob", (0.0, -0.0013, 0.078), _X, _UP, 0.012),
)
_WHITE_YELLOW_MUG: tuple[_Grip, ...] = (
    ("handle", (0.0641, 0.0, 0.056), _UP, _X, 0.0175),
    ("rim_across", (-0.0604, 0.0, 0.093), _Y, _UP, 0.008),
    ("rim_front", (-0.0181, 0.0423, 0.093), _X, _UP, 0.008),
    ("rim_back", (-0.0181, -0.0423, 0.093), _X, _UP, 0.008),
)
_GRIPS: Mapping[str, tuple[_Grip, ...]] = MappingProxyType(
    {
        "moka_pot": _MOKA_POT,
        "yellow_moka_pot": _MOKA_POT,
        "white_yellow_mug": _WHITE_YELLOW_MUG,
    }
)
"""Parts by category of an object: name, middle, the direction along it and away from it, in the frame
of the object's body, and its width, m."""


def graspable_parts_of(env: Any, model: mujoco.MjModel) -> Mapping[str, GraspablePart]:
    """Return handles and knobs by name; a fixture whose parts cannot be made out has none."""
    parts = {}
    for name, fixture in env.fixtures_dict.items():
        ranges = getattr(fixture, "object_properties", {}).get("articulation", {})
        for joint in fixture.joints:
            number = model.joint(joint).id
            part = None
            if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_SLIDE:
                out = model.jnt_axis[number] * np.sign(sum(ranges["default_open_ranges"]))
                part = _part(model, name, f"{joint}_handle", number, out)
            elif ranges.get("default_turnon_ranges"):
                part = _part(model, name, f"{joint}_knob", number, model.jnt_axis[number].copy())
            elif ranges.get("default_open_ranges"):
                part = _part(model, name, f"{joint}_handle", number, _outside(model, number))
            if part is not None:
                parts[part.name] = part
    for name, item in env.objects_dict.items():
        for part_name, pos, along, out, width in _GRIPS.get(item.category_name, ()):
            full = f"{name}_{part_name}"
            parts[full] = GraspablePart(full, name, item.root_body, None, pos, along, out, width)
    return parts


def _part(model: mujoco.MjModel, entity: str, name: str, joint: int, out: Array) -> GraspablePart:
    """Return the foremost box of a joint's body; ``out`` is in the frame of that body."""
    body = int(model.jnt_bodyid[joint])
    boxes = _solid(model, body)
    turns = {box: _matrix(model.geom_quat[box]) for box in boxes}
    foremost = max(boxes, key=lambda box: model.geom_pos[box] @ out + _reach(model, box, turns[box], out))
    turn, size = turns[foremost], model.geom_size[foremost]
    across_out = np.abs(out @ turn) < 0.5
    along = turn[:, int(np.argmax(np.where(across_out, size, 0.0)))]
    position = model.geom_pos[foremost]
    if np.allclose(out, model.jnt_axis[joint]) and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
        # A knob is held on its axis, so that turning it is enough.
        position = model.jnt_pos[joint] + out * ((position - model.jnt_pos[joint]) @ out)
    return GraspablePart(
        name=name,
        entity=entity,
        body=model.body(body).name,
        joint=model.joint(joint).name,
        pos=_vector(position),
        along=_vector(along),
        out=_vector(out),
        width=2 * _reach(model, foremost, turn, np.cross(along, out)),
    )


def _solid(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the geoms of a body that can be touched; LIBERO's microwave is touched and touches nothing."""
    touchable = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    solid: list[int] = np.flatnonzero((model.geom_bodyid == body) & touchable).tolist()
    return solid


def _outside(model: mujoco.MjModel, joint: int) -> Array:
    """Return the unit vector through a closed door, away from its fixture, in the frame of its body."""
    body = int(model.jnt_bodyid[joint])
    pane = max(_solid(model, body), key=lambda geom: float(np.prod(model.geom_size[geom])))
    fixture = np.mean(model.geom_pos[_solid(model, int(model.body_parentid[body]))], axis=0)
    through: Array = _matrix(model.geom_quat[pane])[:, int(np.argmin(model.geom_size[pane]))]
    turned = _matrix(model.body_quat[body])
    away = model.body_pos[body] + turned @ model.geom_pos[pane] - fixture
    return through if (turned @ through) @ away > 0 else -through


def _reach(model: mujoco.MjModel, box: int, turn: Array, way: Array) -> float:
    """Reach of a box from its middle in a direction, m."""
    return float(np.abs(way @ turn) @ model.geom_size[box])


def _matrix(quaternion: Array) -> Array:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
