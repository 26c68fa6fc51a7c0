"""The robot's state on its way to a model. Quaternions are (x, y, z, w), as the observation has them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError

Array = NDArray[np.float64]

HAND_TO_GRIP_SITE = (0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5))
"""The turn (x, y, z, w) from the Panda's hand, whose orientation is observed, to the grip site, which the
controller steers: a quarter turn about z."""


def axis_angle(quaternion: NDArray[Any]) -> Array:
    """(3,) rad: the axis of a rotation times its angle, ``2 acos(w)`` with w cut to [-1, 1].

    The sign of the quaternion is kept, so the angle may exceed pi. robosuite and most models of LIBERO have
    it like this.
    """
    x, y, z, w = _quaternion(quaternion)
    w = min(1.0, max(-1.0, w))
    length = math.sqrt(1.0 - w * w)
    if math.isclose(length, 0.0):
        return np.zeros(3)
    return np.array([x, y, z]) * (2.0 * math.acos(w)) / length


def axis_angle_antipodal(quaternion: NDArray[Any]) -> Array:
    """(3,) rad, as :func:`axis_angle`, of whichever of q and -q has w >= 0: the angle is at most pi.

    Both stand for the same rotation. A model was trained on one of the two rules, and fails on the other.
    """
    values = _quaternion(quaternion)
    return axis_angle(np.negative(values) if values[3] < 0.0 else values)


def rotation_matrix(quaternion: NDArray[Any]) -> Array:
    """(3, 3) of a quaternion (x, y, z, w), whatever its length."""
    values = _quaternion(quaternion)
    length = math.hypot(*values)
    if length == 0.0:
        raise AdapterError("quaternion=(0, 0, 0, 0) is no rotation: a quaternion has a length above 0.")
    x, y, z, w = values / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_6d_columns(quaternion: NDArray[Any]) -> Array:
    """(6,): the first column of the rotation matrix, then the second."""
    matrix = rotation_matrix(quaternion)
    return np.concatenate([matrix[:, 0], matrix[:, 1]])


def rotation_6d_rows(quaternion: NDArray[Any]) -> Array:
    """(6,): the first row of the rotation matrix, then the second."""
    return rotation_matrix(quaternion)[:2].ravel()


def grip_site_quaternion(quaternion: NDArray[Any]) -> Array:
    """(4,): the orientation of the grip site, of that of the hand (``robot0_eef_quat``).

    The grip site is what robosuite's controller calls its end effector (``controller.ee_ori_mat``); it is
    turned by a quarter turn about z. Its position is ``robot0_eef_pos`` itself.
    """
    ax, ay, az, aw = _quaternion(quaternion)
    bx, by, bz, bw = HAND_TO_GRIP_SITE
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def sine_cosine(values: NDArray[Any]) -> NDArray[Any]:
    """(2n,) of (n,): the sine and the cosine of each value, in turn, in the type of the values."""
    return np.stack([np.sin(values), np.cos(values)], axis=-1).ravel()


def pad_to(values: NDArray[Any], length: int) -> NDArray[Any]:
    """(length,) of (n,): zeros after the values."""
    if values.ndim != 1 or len(values) > length:
        raise AdapterError(f"Values of shape {values.shape} cannot be padded to {length}.")
    return np.concatenate([values, np.zeros(length - len(values), dtype=values.dtype)])


def first(values: NDArray[Any], count: int) -> NDArray[Any]:
    """(count,): the first of the values."""
    if len(values) < count:
        raise AdapterError(f"Values of shape {values.shape} are fewer than the {count} asked for.")
    return values[:count].copy()


def entry(values: NDArray[Any], index: int) -> NDArray[Any]:
    """(1,): one of the values."""
    if not 0 <= index < len(values):
        raise AdapterError(f"Values of shape {values.shape} have no entry {index}.")
    return values[index : index + 1].copy()


def _quaternion(values: NDArray[Any]) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (4,):
        raise AdapterError(f"A quaternion has shape (4,): x, y, z, w; this has {array.shape}.")
    return array
