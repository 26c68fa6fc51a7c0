"""Changes of the cameras' images, and the pixel filters that make them.

A filter is a frozen value: its image is a function of the image, the camera, the steps since it was added
and its own fields alone. The number and order of requests for images do not matter.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import cache, lru_cache
from statistics import NormalDist
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.structs import Text, rule
from pytest_libero_max.changes import image_corruptions
from pytest_libero_max.changes.alteration import Alteration, Blended
from pytest_libero_max.changes.factors import Factor, filter_records
from pytest_libero_max.changes.fields import Seed, Share, between
from pytest_libero_max.errors import ChangeError, did_you_mean
from pytest_libero_max.worlds.contract import AlterableWorld, Image
from pytest_libero_max.worlds.robot import CAMERAS


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
    :class:`PublishedSensorCorruption` stands in.
    """

    noise_std: float
    """Standard deviation of the noise, grey levels (0 to 255)."""
    occlusion_fraction: float
    """Share of the image's area that the rectangle covers, 0 to 1; both its sides are the image's sides times
    the square root, rounded."""
    seed: int

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        key = hashlib.sha256(f"libero-max-sensor|{self.seed}|{step}|{camera}".encode()).digest()
        # Little-endian by name, here and below: the same stream on a processor of the other byte order.
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
class PublishedSensorCorruption:
    """Gaussian noise on every channel, then one black rectangle: one stream over both cameras.

    The stream is NumPy's ``RandomState`` seeded with the event's seed plus the observations since onset,
    one a control step. It is spent on the cameras in LIBERO's order, so the second camera's noise is found
    by drawing the first one's. Both images are taken to be of one size, as they are in the benchmark.
    """

    noise_std: float
    """Standard deviation of the noise, grey levels (0 to 255)."""
    occlusion_fraction: float
    """Share of the image's area that the rectangle covers, 0 to 1."""
    seed: int

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        if camera not in CAMERAS:
            return image  # the authors' observations hold no other
        height, width = image.shape[:2]
        side = math.sqrt(self.occlusion_fraction)
        tall, wide = max(1, round(height * side)), max(1, round(width * side))
        stream = np.random.RandomState((self.seed + step) % 2**32)
        corrupted, top, left = image.copy(), 0, 0
        for name in CAMERAS[: CAMERAS.index(camera) + 1]:
            if self.noise_std:
                noise = stream.standard_normal(image.shape)
                if name == camera:
                    noisy = (image + noise * self.noise_std).astype(np.float32)
                    corrupted = noisy.clip(0.0, 255.0).astype(np.uint8)
            if self.occlusion_fraction:
                top, left = stream.randint(height - tall + 1), stream.randint(width - wide + 1)
        if self.occlusion_fraction:
            corrupted[top : top + tall, left : left + wide] = 0
        return corrupted


@dataclass(frozen=True)
class PictureCorruption:
    """Corrupt the images of one camera by one of :data:`.image_corruptions.KINDS`; other cameras stay as is.

    Its randomness comes from SHA-256 of (seed, step, camera): the same step gives the same picture in both
    rollouts of a pair, the next step another one.
    """

    kind: str
    """One of :data:`.image_corruptions.KINDS`."""
    level: int
    """1 to 10."""
    seed: int
    """Seed of all its randomness."""
    camera: str
    blend: float
    """Share of the corrupted picture, 0 to 1."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        if camera != self.camera:
            return image
        key = hashlib.sha256(f"libero-max-picture|{self.seed}|{step}|{camera}".encode()).digest()
        stream = np.random.RandomState(np.frombuffer(key, dtype="<u4").astype(np.uint32))
        from pytest_libero_max.changes import image_loops

        picture = image_corruptions.scratch("picture", image.shape)
        np.divide(image, 255.0, out=picture)
        bad = image_corruptions.KINDS[self.kind](picture, self.level, stream)
        corrupted: Image = image_loops.mix(picture, bad, self.blend)
        return corrupted


@dataclass(frozen=True)
class Glare:
    """A white veil over the images of every camera, densest around one place."""

    strength: float
    """0 to 1; at 1 its middle is white."""
    across: float
    """Position of its middle, share of the width from the left."""
    up: float
    """Position of its middle, share of the height from the bottom."""
    radius: float
    """Distance at which a third of it is left, share of the width."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        veiled = np.subtract(255.0, image, out=image_corruptions.scratch("work", image.shape))
        veiled *= _veil(self, *image.shape[:2])
        veiled += image
        return np.rint(veiled, out=veiled).astype(np.uint8)


class FilterChange(Alteration):
    """A change that adds filters to the images."""

    touched: ClassVar[frozenset[Factor]] = frozenset({"pixels"})

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        return {"filters": filter_records(world)}


@dataclass(frozen=True)
class SetSensorCorruption(FilterChange):
    """Let every image from now on pass through a :class:`SensorCorruption`."""

    operation: ClassVar[str] = "set_sensor_corruption"
    magnitudes = ("noise_std", "occlusion_fraction")  # the pattern and the rectangle's place stay

    noise_std: Annotated[float, between(0.0, 255.0)]
    """Standard deviation of the noise, grey levels (0 to 255), at least 0."""
    occlusion_fraction: Share
    """Share of the image's area under the black rectangle, 0 to 1."""
    seed: Seed
    """Seed of all its randomness, at least 0."""

    def _alter(self, world: AlterableWorld) -> None:
        if self.noise_std or self.occlusion_fraction:
            kind = PublishedSensorCorruption if world.semantics == "published" else SensorCorruption
            world.add_filter(kind(self.noise_std, self.occlusion_fraction, self.seed))


@dataclass(frozen=True)
class CorruptPicture(FilterChange, Blended):
    """Let one camera's pictures pass through a :class:`PictureCorruption` from now on."""

    operation: ClassVar[str] = "corrupt_picture"

    camera: Text
    """Camera name, for example ``agentview``."""
    kind: Text
    """``motion_blur``, ``gaussian_blur``, ``zoom_blur``, ``fog`` or ``glass_blur``."""
    level: Annotated[
        int, rule(f"an integer from 1 to {image_corruptions.LEVELS}", ge=1, le=image_corruptions.LEVELS)
    ]
    """1 to 10."""
    seed: Seed
    """Seed of all its randomness, at least 0."""
    blend: Share | None = None
    """Share of the corrupted picture, 0 to 1; None means all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known = image_corruptions.KINDS
        if self.kind not in known:
            raise ChangeError.seen(
                f"{self.operation}.kind", self.kind, f" is not a corruption. {did_you_mean(self.kind, known)}"
            )

    def _alter(self, world: AlterableWorld) -> None:
        if self.share > 0.0:
            world.add_filter(PictureCorruption(self.kind, self.level, self.seed, self.camera, self.share))


@dataclass(frozen=True)
class SetGlare(FilterChange):
    """Let every picture from now on pass through a :class:`Glare`."""

    operation: ClassVar[str] = "set_glare"
    magnitudes = ("strength",)

    strength: Share
    """0 to 1."""
    across: Share
    """Position of its middle, share of the picture's width from the left, 0 to 1."""
    up: Share
    """Position of its middle, share of the picture's height from the lower edge of an upright picture."""
    radius: Annotated[float, between(0.01, 1.0)]
    """Distance at which a third of it is left, share of the picture's width, above 0."""

    def _alter(self, world: AlterableWorld) -> None:
        if self.strength:
            world.add_filter(Glare(self.strength, self.across, self.up, self.radius))


@lru_cache(maxsize=2)
def _veil(glare: Glare, height: int, width: int) -> image_corruptions.Picture:
    """Return the share of white in every pixel, (height, width, 1)."""
    rows, columns = np.mgrid[0:height, 0:width]
    away = ((columns + 0.5) / width - glare.across) ** 2 + ((rows + 0.5) / height - glare.up) ** 2
    veil: image_corruptions.Picture = glare.strength * np.exp(-away / glare.radius**2)[..., None]
    return veil


@cache
def _normal_quantiles() -> NDArray[np.float32]:
    """Return the 65,536 equally likely values that stand for a standard normal variable."""
    normal, count = NormalDist(), 2**16
    return np.array([normal.inv_cdf((i + 0.5) / count) for i in range(count)], dtype=np.float32)
