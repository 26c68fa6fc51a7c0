"""Changes of what the cameras deliver, and the pixel filters that do it.

A filter is a frozen value: its image is a function of the image, the camera, the steps since it was added
and its own fields, and of nothing else. How often or in which order anybody looks does not matter.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import ManifestFields, integer, number, strength_of
from pytest_libero_max.changes.published import PublishedSensorCorruption
from pytest_libero_max.worlds.contract import Image, World


@dataclass(frozen=True)
class Brightness:
    """Multiply every pixel by ``factor``, clipped to 0 to 255 and cut to whole numbers."""

    factor: float

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        table = (np.arange(256) * self.factor).clip(0, 255).astype(np.uint8)
        return table[image]


@dataclass(frozen=True)
class SensorCorruption:
    """Gaussian noise on every channel, then one black rectangle at a random place.

    Everything random comes from a stream of its own, seeded by SHA-256 of (seed, step, camera) into
    NumPy's ``RandomState``, whose streams are frozen. Each channel of a pixel takes 16 bits of it, as the
    level of a quantile of the normal distribution, which costs less than a draw of ``normal``.

    The authors draw from one stream over both cameras in the order in which they are rendered, counted in
    looks. Here each camera has its own stream, counted in control steps, so a policy that asks for one
    camera sees the pixels it would see beside another. Where published results are to be matched,
    :class:`.published.PublishedSensorCorruption` stands in.

    Attributes:
        noise_std: Standard deviation of the noise, grey levels (0 to 255).
        occlusion_fraction: Share of the image's area that the rectangle covers, 0 to 1; both its sides
            are the image's sides times the square root, rounded.
        seed: Seed of the event.
    """

    noise_std: float
    occlusion_fraction: float
    seed: int

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        key = hashlib.sha256(f"libero-max-sensor|{self.seed}|{step}|{camera}".encode()).digest()
        stream = np.random.RandomState(np.frombuffer(key, dtype="<u4").astype(np.uint32))
        # The place is drawn first, and relative to the room there is, so that it stays
        # the same when the image size or the strength of the noise differs.
        across, down = stream.random_sample(2)
        draws = np.frombuffer(stream.bytes(2 * image.size), dtype="<u2").reshape(image.shape)
        noisy = image + _normal_quantiles()[draws] * np.float32(self.noise_std)
        height, width = image.shape[:2]
        side = float(np.sqrt(self.occlusion_fraction))
        tall, wide = round(height * side), round(width * side)
        top, left = int(down * (height - tall + 1)), int(across * (width - wide + 1))
        noisy[top : top + tall, left : left + wide] = 0.0
        corrupted: Image = noisy.clip(0.0, 255.0).astype(np.uint8)
        return corrupted


@dataclass(frozen=True)
class SetSensorCorruption(ManifestFields):
    """Let every image from now on pass through a :class:`SensorCorruption`.

    Attributes:
        noise_std: Standard deviation of the noise, grey levels (0 to 255), at least 0.
        occlusion_fraction: Share of the image's area under the black rectangle, 0 to 1.
        seed: Seed of all its randomness, at least 0.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_sensor_corruption"

    noise_std: float
    occlusion_fraction: float
    seed: int

    def __post_init__(self) -> None:
        self._set("noise_std", number("set_sensor_corruption.noise_std", self.noise_std, 0.0))
        where = "set_sensor_corruption.occlusion_fraction"
        self._set("occlusion_fraction", number(where, self.occlusion_fraction, 0.0, 1.0))
        self._set("seed", integer("set_sensor_corruption.seed", self.seed))

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"pixels"})

    def apply(self, world: World) -> Evidence:
        before = {"filters": filter_records(world)}
        if self.noise_std or self.occlusion_fraction:
            kind = PublishedSensorCorruption if world.semantics == "published" else SensorCorruption
            world.add_filter(kind(self.noise_std, self.occlusion_fraction, self.seed))
        after = {"filters": filter_records(world)}
        return Evidence(self.operation, tuple(sorted(self.factors)), before, after)

    def scaled(self, strength: float) -> SetSensorCorruption:
        """Noise and covered area multiplied by ``strength``; noise pattern and rectangle's place stay."""
        s = strength_of(self.operation, strength)
        if s == 1.0:
            return self
        return replace(self, noise_std=self.noise_std * s, occlusion_fraction=self.occlusion_fraction * s)


@cache
def _normal_quantiles() -> NDArray[np.float32]:
    """The 65,536 equally likely values that stand for a standard normal variable."""
    normal, count = NormalDist(), 2**16
    return np.array([normal.inv_cdf((i + 0.5) / count) for i in range(count)], dtype=np.float32)


def filter_records(world: World) -> list[dict[str, Any]]:
    """The world's active pixel filters as JSON values, in the order in which they act."""
    records = []
    for pixel_filter, since in world.filters:
        value: Any = pixel_filter
        names = [field.name for field in dataclasses.fields(value)] if dataclasses.is_dataclass(value) else []
        parameters = {name: getattr(value, name) for name in names}
        records.append({"filter": type(pixel_filter).__name__, "since_step": since, **parameters})
    return records
