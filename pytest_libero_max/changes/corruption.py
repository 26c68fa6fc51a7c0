"""Changes of one camera's picture: a published corruption, or glare."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_libero_max.changes import blurs
from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import ManifestFields, integer, number, strength_of, text
from pytest_libero_max.changes.pixels import filter_records
from pytest_libero_max.errors import ChangeError, did_you_mean
from pytest_libero_max.worlds.contract import Image, World


@dataclass(frozen=True)
class PictureCorruption:
    """One camera's picture through one of :data:`.blurs.KINDS`; the other cameras' stay as they are.

    What is random about it comes from SHA-256 of (seed, step, camera): the same step gives the same
    picture in both rollouts of a pair, the next step another one.

    Attributes:
        kind: One of :data:`.blurs.KINDS`.
        level: 1 to 10.
        seed: Seed of all its randomness.
        camera: The camera it belongs to.
        blend: Share of the corrupted picture, 0 to 1.
    """

    kind: str
    level: int
    seed: int
    camera: str
    blend: float

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        if camera != self.camera:
            return image
        key = hashlib.sha256(f"libero-max-picture|{self.seed}|{step}|{camera}".encode()).digest()
        stream = np.random.RandomState(np.frombuffer(key, dtype="<u4").astype(np.uint32))
        picture = image / 255.0
        bad = blurs.KINDS[self.kind](picture, self.level, stream)
        mixed = picture + (bad - picture) * self.blend
        corrupted: Image = np.rint(mixed * 255.0).clip(0, 255).astype(np.uint8)
        return corrupted


@dataclass(frozen=True)
class Glare:
    """A lamp that shines into every lens: a white veil, thick around one place of the picture.

    Attributes:
        strength: 0 to 1; at 1 its middle is white.
        across: Where its middle is, share of the width from the left.
        up: Where its middle is, share of the height from the bottom.
        radius: Distance at which a third of it is left, share of the width.
    """

    strength: float
    across: float
    up: float
    radius: float

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        height, width = image.shape[:2]
        rows, columns = np.mgrid[0:height, 0:width]
        away = ((columns + 0.5) / width - self.across) ** 2 + ((rows + 0.5) / height - self.up) ** 2
        veil = self.strength * np.exp(-away / self.radius**2)[..., None]
        veiled: Image = np.rint(image + (255.0 - image) * veil).astype(np.uint8)
        return veiled


@dataclass(frozen=True)
class CorruptPicture(ManifestFields):
    """Let one camera's pictures pass through a :class:`PictureCorruption` from now on.

    Attributes:
        camera: Camera name, for example ``agentview``.
        kind: ``motion_blur``, ``gaussian_blur``, ``zoom_blur``, ``fog`` or ``glass_blur``.
        level: 1 to 10.
        seed: Seed of all its randomness, at least 0.
        blend: Share of the corrupted picture, 0 to 1; None means all of it.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "corrupt_picture"

    camera: str
    kind: str
    level: int
    seed: int
    blend: float | None = None

    def __post_init__(self) -> None:
        where = self.operation
        text(f"{where}.camera", self.camera)
        if text(f"{where}.kind", self.kind) not in blurs.KINDS:
            raise ChangeError(
                f"{where}.kind={self.kind!r} is not a corruption. {did_you_mean(self.kind, blurs.KINDS)}"
            )
        integer(f"{where}.level", self.level, 1, blurs.LEVELS)
        integer(f"{where}.seed", self.seed)
        if self.blend is not None:
            self._set("blend", number(f"{where}.blend", self.blend, 0.0, 1.0))

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"pixels"})

    def apply(self, world: World) -> Evidence:
        before = {"filters": filter_records(world)}
        share = 1.0 if self.blend is None else self.blend
        if share > 0.0:
            world.add_filter(PictureCorruption(self.kind, self.level, self.seed, self.camera, share))
        after = {"filters": filter_records(world)}
        return Evidence(self.operation, tuple(sorted(self.factors)), before, after)

    def scaled(self, strength: float) -> CorruptPicture:
        """The corrupted picture mixed into the clean one with the share ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, blend=(1.0 if self.blend is None else self.blend) * s)


@dataclass(frozen=True)
class SetGlare(ManifestFields):
    """Let every picture from now on pass through a :class:`Glare`.

    Attributes:
        strength: 0 to 1.
        across: Where its middle is, share of the picture's width from the left, 0 to 1.
        up: Where its middle is, share of the picture's height from the lower edge of an upright picture.
        radius: Distance at which a third of it is left, share of the picture's width, above 0.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_glare"

    strength: float
    across: float
    up: float
    radius: float

    def __post_init__(self) -> None:
        for name, low in (("strength", 0.0), ("across", 0.0), ("up", 0.0), ("radius", 0.01)):
            self._set(name, number(f"set_glare.{name}", getattr(self, name), low, 1.0))

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"pixels"})

    def apply(self, world: World) -> Evidence:
        before = {"filters": filter_records(world)}
        if self.strength:
            world.add_filter(Glare(self.strength, self.across, self.up, self.radius))
        after = {"filters": filter_records(world)}
        return Evidence(self.operation, tuple(sorted(self.factors)), before, after)

    def scaled(self, strength: float) -> SetGlare:
        """The veil's strength multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, strength=self.strength * s)
