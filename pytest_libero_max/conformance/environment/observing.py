"""Observations of environments of others, read by what they mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.robot import CAMERAS

ROLES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "agentview": ("agentview_image", "pixels/image", "images/agentview", "observation/image", "image"),
        "robot0_eye_in_hand": (
            "robot0_eye_in_hand_image",
            "pixels/image2",
            "images/wrist",
            "observation/wrist_image",
            "wrist_image",
        ),
        "position": ("robot0_eef_pos", "robot_state/eef/pos"),
        "quaternion": ("robot0_eef_quat", "robot_state/eef/quat"),
        "gripper": ("robot0_gripper_qpos", "robot_state/gripper/qpos"),
        "joints": ("robot0_joint_pos", "robot_state/joints/pos"),
        "state": ("states", "observation/state", "state"),
        "instruction": ("task_description", "prompt", "instruction"),
    }
)
"""Names under which a thing is found in an observation, by its role: the cameras' images, the hand's position
(m) and quaternion (xyzw), the finger joints (m), the arm's joints (rad), a state vector of eight (position,
axis times angle, gripper), and the instruction."""

Reading = Mapping[str, Any]
"""What an observation holds, by role."""


def read_observation(raw: Any, keys: Mapping[str, str], first: bool = False) -> dict[str, Any]:
    """Return what an observation holds, by role; what it lacks is left out.

    Args:
        keys: Places that are declared, by role.
        first: True for a vector of environments, the first of which is read.
    """
    flat = dict(_flattened(raw))
    reading = {}
    for role, names in ROLES.items():
        wanted = (keys[role],) if role in keys else names
        key = next((name for name in wanted if name in flat), None)
        if key is not None and flat[key] is not None:
            value = flat[key][0] if first else flat[key]
            reading[role] = value if isinstance(value, str) else np.asarray(value)
    return reading


def _flattened(raw: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(raw, Mapping):
        for key, value in raw.items():
            yield from _flattened(value, f"{path}/{key}" if path else str(key))
    else:
        yield path, raw


def images_of(reading: Reading) -> dict[str, NDArray[Any]]:
    """Return the images of a reading by camera."""
    return {camera: reading[camera] for camera in CAMERAS if camera in reading}


def hand_of(reading: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the position of the hand (3,) and of its fingers (2,), m, from wherever a reading has them.

    Raises:
        SubstrateError: It has neither of them.
    """
    state = reading.get("state")
    if "position" in reading and "gripper" in reading:
        position, gripper = reading["position"], reading["gripper"]
    elif state is not None and np.shape(state) == (8,):
        position, gripper = state[:3], state[6:]
    else:
        raise SubstrateError(
            "The observation has no position of the hand and its fingers. Declare where they are: "
            "DeclaredEnvironment(keys={'position': 'KEY', 'gripper': 'KEY'})."
        )
    return np.asarray(position, dtype=np.float64), np.asarray(gripper, dtype=np.float64)


def differing(first: Reading, second: Reading) -> list[str]:
    """Return what differs between two readings, in words with the size of the difference."""
    parts = []
    for role, value in first.items():
        later = second.get(role)
        if isinstance(value, str) or later is None or np.shape(value) != np.shape(later):
            if value is not later and not (isinstance(value, str) and value == later):
                parts.append(role)
        elif not np.array_equal(value, later):
            parts.append(f"{role} {_size(role, value, later)}")
    return parts


def _size(role: str, first: NDArray[Any], second: NDArray[Any]) -> str:
    apart = np.abs(np.asarray(first, dtype=float) - np.asarray(second, dtype=float))
    if role in CAMERAS:
        share = float((apart.reshape(*apart.shape[:2], -1).max(axis=2) > 0).mean())
        return f"in {100 * share:.1f} % of its pixels"
    if role in ("position", "gripper"):
        return f"by {1000 * apart.max():.3g} mm"
    return f"by {apart.max():.3g}"
