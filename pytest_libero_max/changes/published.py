"""Pixel noise drawn exactly as the authors draw it, for genuine scenes with published semantics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_libero_max.worlds.contract import CAMERAS, Image


@dataclass(frozen=True)
class PublishedSensorCorruption:
    """Gaussian noise on every channel, then one black rectangle: one stream over both cameras.

    The stream is NumPy's ``RandomState`` seeded with the event's seed plus the observations since onset,
    one a control step. It is spent on the cameras in LIBERO's order, so the second camera's noise is found
    by drawing the first one's. Both images are taken to be of one size, as they are in the benchmark.

    Attributes:
        noise_std: Standard deviation of the noise, grey levels (0 to 255).
        occlusion_fraction: Share of the image's area that the rectangle covers, 0 to 1.
        seed: Seed of the event.
    """

    noise_std: float
    occlusion_fraction: float
    seed: int

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        if camera not in CAMERAS:
            return image  # the authors' observations hold no other
        stream = np.random.RandomState((self.seed + step) % 2**32)
        height, width = image.shape[:2]
        side = math.sqrt(self.occlusion_fraction)
        tall, wide = max(1, round(height * side)), max(1, round(width * side))
        work = image.astype(np.float32)
        for name in CAMERAS[: CAMERAS.index(camera) + 1]:
            noise = stream.normal(0.0, self.noise_std, size=image.shape) if self.noise_std else None
            corner = (0, 0)
            if self.occlusion_fraction:
                corner = stream.randint(height - tall + 1), stream.randint(width - wide + 1)
            if name == camera:
                if noise is not None:
                    work += noise
                if self.occlusion_fraction:
                    top, left = corner
                    work[top : top + tall, left : left + wide] = 0.0
        corrupted: Image = work.clip(0, 255).astype(np.uint8)
        return corrupted
