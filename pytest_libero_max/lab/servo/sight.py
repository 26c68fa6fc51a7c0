"""Finding a known object in the image of the main camera: by its colours and its outline.

The knowledge is that of demonstrations: the look of the object in unmodified scenes
(``servo_colours.json``, from ``tests.lab.servo.servo_colours``), how large it is, and how high it stands.
An object is where its outline, projected by the nominal camera, holds the most of its colours inside and the
least around it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.rotations import Quaternion

Array = NDArray[np.float64]
Chances = NDArray[np.float32]
"""(size, size): how likely each pixel shows the object, 0 to 1."""

LEVELS = 12
"""Steps into which each colour channel is divided, by its square root, finer where it is dark."""

_CIRCLE = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
_CIRCLE.setflags(write=False)
_RING_PX = 6  # how far around the outline another colour is expected
_SUBPIXEL_BITS = 4
_COARSE_M = 0.02
_FINE_M = (0.01, 0.004, 0.0015)
_MOST_MOVES = 8
_SAMPLES = 150


@dataclass(frozen=True)
class NominalCamera:
    """A pinhole camera."""

    position: tuple[float, float, float]
    """M, world."""
    orientation: Quaternion
    """Wxyz; MuJoCo's cameras look along -z, with x to the right and y up."""
    fov_deg: float
    """Vertical field of view, degrees."""
    size: int
    """Side of the square image, pixels."""

    def project(self, points: Array) -> Array:
        """(n, 2) column and row, pixels, in the upright image, of (n, 3) points in front of the camera, m."""
        local = (points - np.array(self.position)) @ rotations.matrix(self.orientation)
        focal = self.size / 2 / math.tan(math.radians(self.fov_deg) / 2)
        middle = (self.size - 1) / 2
        across, up = local[:, 0] / -local[:, 2], local[:, 1] / -local[:, 2]
        return np.stack([middle + focal * across, middle - focal * up], axis=1)


@dataclass(frozen=True)
class Shape:
    """The outline of an object that stands upright."""

    rings: tuple[tuple[float, float, float], ...]
    """Half width along x and along y, and height above the foot, m, from below."""
    rounded: bool = False
    """True if they are ellipses; otherwise they are rectangles."""

    @property
    def height(self) -> float:
        """Height, m."""
        return self.rings[-1][2]

    @property
    def radius(self) -> float:
        """Half width along y of the topmost ring, m."""
        return self.rings[-1][1]

    def points(self, position: Array) -> Array:
        """(n, 3) points on its outline, m, when the middle of its foot is at ``position``, (3,) m."""
        if self.rounded:
            circle = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1)
        else:
            circle = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])
        rings = [np.column_stack([circle * (x, y), np.full(len(circle), z)]) for x, y, z in self.rings]
        return np.concatenate(rings) + position


@dataclass(frozen=True)
class Sighting:
    """Place at which something was seen."""

    position: Array
    """(3,) m, the middle of its foot."""
    score: float
    """Excess of its colours inside its outline over those around it, -1 to 1."""


@dataclass(frozen=True)
class Area:
    """The rectangle in which something is looked for, and the height at which it stands, m."""

    low: tuple[float, float]
    high: tuple[float, float]
    height: float

    @classmethod
    def around(cls, position: Array, reach: float) -> Area:
        """Return the square within ``reach`` m of a position, (3,) m."""
        x, y, z = (float(value) for value in position)
        return cls((x - reach, y - reach), (x + reach, y + reach), z)


@cache
def colour_table() -> Mapping[str, Mapping[str, int]]:
    """For each category the colours that it has, with their likelihood in percent."""
    text = Path(__file__).with_name("servo_colours.json").read_text(encoding="utf-8")
    table: dict[str, dict[str, int]] = json.loads(text)
    return table


def colour_codes(image: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Return the colour of each pixel as one number, 0 to ``LEVELS**3 - 1``."""
    levels = np.floor(np.sqrt(np.arange(256) / 256) * LEVELS).astype(np.intp)
    codes: NDArray[np.intp] = levels[image] @ np.array([LEVELS**2, LEVELS, 1])
    return codes


@cache
def _likelihoods(category: str) -> Chances:
    values = np.zeros(LEVELS**3, dtype=np.float32)
    for code, percent in colour_table()[category].items():
        values[int(code)] = percent / 100
    return values


def chances(image: NDArray[np.uint8], category: str) -> Chances:
    """Likelihood that each pixel of an upright image shows an object of a category, by its colour alone."""
    likelihoods: Chances = _likelihoods(category)[colour_codes(image)]
    return likelihoods


def find(likely: Chances, camera: NominalCamera, shape: Shape, area: Area, leash: float = 0.0) -> Sighting:
    """Return the likeliest place of an object in an area; ``leash`` is taken off a m from its middle."""
    xs, ys = (
        np.arange(low, high + _COARSE_M / 2, _COARSE_M) for low, high in zip(area.low, area.high, strict=True)
    )
    scores = np.array([_row_scores(likely, camera, shape, x, ys, area.height) for x in xs])
    if leash:
        middle = (np.array(area.low) + np.array(area.high)) / 2
        scores -= leash * np.hypot(xs[:, None] - middle[0], ys[None] - middle[1])
    i, j = np.unravel_index(int(np.argmax(scores)), scores.shape)
    return _climb(likely, camera, shape, np.array([xs[i], ys[j], area.height]))


def _row_scores(
    likely: Chances, camera: NominalCamera, shape: Shape, x: float, ys: Array, height: float
) -> Array:
    """Scores along y, where the outline hardly changes, by samples of its pixels."""
    middle = np.array([x, float(ys.mean()), height])
    inside, around, corner = _masks(camera.project(shape.points(middle)))
    foot = camera.project(middle[None])[0]
    feet = camera.project(np.column_stack([np.full(len(ys), x), ys, np.full(len(ys), height)]))
    means = []
    for mask in (inside, around):
        offsets = np.argwhere(mask)[:, ::-1] + corner - foot
        offsets = offsets[:: max(1, len(offsets) // _SAMPLES)]
        pixels = np.rint(feet[:, None] + offsets).astype(np.intp)
        shown = ((pixels >= 0) & (pixels < camera.size)).all(axis=2)
        pixels = pixels.clip(0, camera.size - 1)
        means.append(np.where(shown, likely[pixels[..., 1], pixels[..., 0]], 0.0).mean(axis=1))
    return np.asarray(means[0] - means[1], dtype=np.float64)


def _climb(likely: Chances, camera: NominalCamera, shape: Shape, position: Array) -> Sighting:
    best = score(likely, camera, shape, position)
    ways = [np.array([i, j, 0.0]) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    for step in _FINE_M:
        for _ in range(_MOST_MOVES):
            there = [position + step * way for way in ways]
            scores = [score(likely, camera, shape, place) for place in there]
            if max(scores) <= best:
                break
            best = max(scores)
            position = there[scores.index(best)]
    return Sighting(position, best)


def score(likely: Chances, camera: NominalCamera, shape: Shape, position: Array) -> float:
    """Return the score of an object at a position, (3,) m; -1 where it would be outside the image."""
    inside, around, (left, top) = _masks(camera.project(shape.points(position)))
    rows, columns = (
        slice(*np.clip((start, start + length), 0, camera.size))
        for start, length in ((top, inside.shape[0]), (left, inside.shape[1]))
    )
    part = likely[rows, columns]
    cut = (slice(rows.start - top, rows.stop - top), slice(columns.start - left, columns.stop - left))
    sums = [(float((part * mask[cut]).sum()), int(mask[cut].sum())) for mask in (inside, around)]
    if not all(count for _, count in sums):
        return -1.0
    return sums[0][0] / sums[0][1] - sums[1][0] / sums[1][1]


def _masks(outline: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint8], tuple[int, int]]:
    """Return the pixels inside the hull of projected points, those around it, and the masks' corner."""
    import cv2

    low = np.floor(outline.min(axis=0)).astype(int) - _RING_PX - 1
    width, height = np.ceil(outline.max(axis=0)).astype(int) + _RING_PX + 2 - low
    hull = cv2.convexHull(np.rint((outline - low) * 2**_SUBPIXEL_BITS).astype(np.int32))
    inside = np.zeros((height, width), dtype=np.uint8)
    cv2.fillConvexPoly(inside, hull, 1, shift=_SUBPIXEL_BITS)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _RING_PX + 1,) * 2)
    around = cv2.dilate(inside, disc) - inside
    return inside, np.asarray(around, dtype=np.uint8), (int(low[0]), int(low[1]))


def overlap(outline: Array, other: Array) -> float:
    """Return the share of the hull of projected points that lies inside the hull of others, 0 to 1."""
    import cv2

    hulls = [cv2.convexHull(points.astype(np.float32)) for points in (outline, other)]
    shared, _ = cv2.intersectConvexConvex(*hulls)
    return float(shared) / max(1e-6, cv2.contourArea(hulls[0]))
