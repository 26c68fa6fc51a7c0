"""The main camera as it stands in an unmodified scene: where a point of the world is in its image.

A policy that learned from demonstrations knows its camera in the same way: as it was then.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.rotations import Quaternion

Array = NDArray[np.float64]


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
