"""Rotations as unit quaternions (w, x, y, z): the only place of the package that computes with them.

Plain floats in a fixed order of operations, so that the result depends on no BLAS and no instruction set.

The three ``unit_*`` functions divide by the same length, computed in three ways that differ in its last bit:
for 20% of random quaternions by squares or by hypot, and for 24% of the turns that the source variations
contain. Each caller keeps the one that it began with, because world digests of the frozen tracks contain
its result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from pytest_libero_max.worlds.contract import Array

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

_SMALL_RAD = 1e-3
"""Angle up to which SciPy computes a series."""


def quaternion(values: Sequence[float] | Array) -> Quaternion:
    """Four numbers as plain floats."""
    w, x, y, z = (float(value) for value in values)
    return w, x, y, z


def about(axis: Sequence[float], angle: float) -> Quaternion:
    """Rotation by ``angle`` rad about a unit ``axis``."""
    s = math.sin(angle / 2)
    return math.cos(angle / 2), axis[0] * s, axis[1] * s, axis[2] * s


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation ``b`` followed by ``a``."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def yawed(q: Quaternion, degrees: float) -> Quaternion:
    """Return the rotation ``q`` followed by a turn about the z axis, counter-clockwise seen from above.

    As :func:`multiply` with a rotation about z, but without its products with zero, which would turn some
    -0.0 into 0.0. The length may be off by rounding.
    """
    half = math.radians(degrees) / 2
    c, s = math.cos(half), math.sin(half)
    w, x, y, z = q
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def inverse(q: Quaternion) -> Quaternion:
    """Return the rotation back."""
    return q[0], -q[1], -q[2], -q[3]


def rotate(q: Quaternion, vector: Sequence[float] | Array) -> Vector:
    """Return a vector (3,) turned by ``q``."""
    x, y, z = (float(part) for part in vector)
    _, *turned = multiply(multiply(q, (0.0, x, y, z)), inverse(q))
    return turned[0], turned[1], turned[2]


def between(start: Quaternion, end: Quaternion, share: float) -> Quaternion:
    """Return the rotation a share (0 to 1) of the way along the shorter arc."""
    cosine = _dot(start, end)
    if cosine < 0.0:
        cosine, end = -cosine, (-end[0], -end[1], -end[2], -end[3])
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-9:
        return start
    first, second, whole = math.sin((1 - share) * angle), math.sin(share * angle), math.sin(angle)
    return quaternion([(first * a + second * b) / whole for a, b in zip(start, end, strict=True)])


def of_axes(x: Sequence[float] | Array, y: Sequence[float] | Array, z: Sequence[float] | Array) -> Quaternion:
    """Return the rotation that takes the frame of the world to these axes, unit vectors (3,).

    Raises:
        ValueError: It is a half turn or close to one, for which this formula has no answer.
    """
    w = math.sqrt(max(1.0 + x[0] + y[1] + z[2], 0.0)) / 2
    if w < 1e-6:
        raise ValueError("a half turn")
    return quaternion([w, (y[2] - z[1]) / (4 * w), (z[0] - x[2]) / (4 * w), (x[1] - y[0]) / (4 * w)])


def _dot(p: Quaternion, q: Quaternion) -> float:
    """Return the sum of the products, rounded after every operation (``sum``: only before Python 3.12)."""
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]


def unit_by_hypot(q: Quaternion) -> Quaternion:
    """``q`` divided by its length, which ``math.hypot`` computes."""
    return _divided(q, math.hypot(*q))


def unit_by_squares(q: Quaternion) -> Quaternion:
    """``q`` divided by its length: the root of the squares' sum, rounded after every operation."""
    return _divided(q, math.sqrt(_dot(q, q)))


def unit_fused(q: Quaternion) -> Quaternion:
    """``q`` divided by its length, which :func:`fused_dot` computes."""
    return _divided(q, math.sqrt(fused_dot(q, q)))


def fused_dot(a: Sequence[float] | Array, b: Sequence[float] | Array) -> float:
    """Return the dot product of two short vectors; every product is added to the sum before it is rounded.

    It has the bits of a BLAS on processors with fused multiply-add, on every processor.
    """
    total = Fraction(0)
    for one, other in zip(a, b, strict=True):
        total = Fraction(float(total + Fraction(float(one)) * Fraction(float(other))))
    return float(total)


def composed(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation ``b`` followed by ``a``, of unit length, with the bits of SciPy's ``Rotation``.

    Its products take some twenty times as long as this, most of it to look at their arguments.
    """
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    x = aw * bx + bw * ax + (ay * bz - az * by)
    y = aw * by + bw * ay + (az * bx - ax * bz)
    z = aw * bz + bw * az + (ax * by - ay * bx)
    w = aw * bw - ax * bx - ay * by - az * bz
    return _divided((w, x, y, z), math.sqrt(x * x + y * y + z * z + w * w))


def of_vector(vector: Sequence[float]) -> Quaternion:
    """Return the rotation about a vector (3,) by its length in rad, as ``Rotation.from_rotvec``."""
    x, y, z = vector
    angle = math.sqrt(x * x + y * y + z * z)
    square = angle * angle
    small = angle <= _SMALL_RAD
    scale = 0.5 - square / 48 + square * square / 3840 if small else math.sin(angle / 2) / angle
    return math.cos(angle / 2), scale * x, scale * y, scale * z


def vector_of(q: Quaternion) -> Vector:
    """Return the vector about which a unit ``q`` rotates by its length, rad, as ``Rotation.as_rotvec``."""
    w, x, y, z = q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    angle = 2 * math.atan2(math.sqrt(x * x + y * y + z * z), w)
    square = angle * angle
    small = angle <= _SMALL_RAD
    scale = 2 + square / 12 + 7 * square * square / 2880 if small else angle / math.sin(angle / 2)
    return scale * x, scale * y, scale * z


def matrix(q: Quaternion) -> Array:
    """(3, 3) rotation matrix."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _divided(q: Quaternion, length: float) -> Quaternion:
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length
