"""Inputs taken away from a policy: images black, still or of another scene, and a state of zeros.

The scene stays as it is. What remains of a policy's success says what it can do without the input.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS
from pytest_libero_max.benchmark.structs import Count, Flag, Positive, Text, rule
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.changes.pixels import FilterChange
from pytest_libero_max.worlds.contract import AlterableWorld, Image, World

_Cameras = Annotated[tuple[Text, ...], rule("a list of camera names")]
_SomeCameras = Annotated[_Cameras, rule("a list of at least one camera name", min_length=1)]


@dataclass(frozen=True)
class HiddenInputs:
    """Black images of some cameras."""

    cameras: tuple[str, ...]
    hides_state: bool
    """True if the world also shows a robot state of zeros."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        return np.zeros_like(image) if camera in self.cameras else image


@dataclass(frozen=True)
class StillImages:
    """The images of some cameras as they were once, here or in another scene."""

    digest: str
    """SHA-256 of the images, hexadecimal."""
    shape: tuple[int, int]
    """Height and width, pixels. Requests for another size get the nearest pixels."""
    images: tuple[tuple[str, bytes], ...] = field(repr=False)
    """The bytes of each image, by camera."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        kept = dict(self.images).get(camera)
        if kept is None:
            return image
        still = np.frombuffer(kept, dtype=np.uint8).reshape(*self.shape, 3)
        rows, columns = (
            np.arange(wanted) * size // wanted for size, wanted in zip(self.shape, image.shape, strict=False)
        )
        shown: Image = still[rows][:, columns]
        return shown


def _still_images(world: World, cameras: tuple[str, ...], shape: tuple[int, int]) -> StillImages:
    """Return the images of the cameras as the world shows them now."""
    shown = world.observe(cameras, shape)
    images = tuple((camera, shown[f"{camera}_image"].tobytes()) for camera in cameras)
    digest = hashlib.sha256(repr(cameras).encode() + b"".join(image for _, image in images))
    return StillImages(digest.hexdigest(), shape, images)


@dataclass(frozen=True)
class HideInputs(Indivisible, FilterChange):
    """Show black images of some cameras from now on, and, if asked for, a robot state of zeros.

    The orientation of such a state is the identity: a quaternion of zeros is none.
    """

    operation: ClassVar[str] = "hide_inputs"

    cameras: _Cameras
    """Names of the cameras; none for the state alone."""
    state: Flag
    """True to hide the state."""

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"pixels", "state"} if self.state else {"pixels"})

    def _alter(self, world: AlterableWorld) -> None:
        world.add_filter(HiddenInputs(self.cameras, self.state))


@dataclass(frozen=True)
class FreezeImages(Indivisible, FilterChange):
    """Show the images of some cameras as they are now from now on."""

    operation: ClassVar[str] = "freeze_images"

    cameras: _SomeCameras
    height: Positive
    """Height of the images that are kept, pixels."""
    width: Positive
    """Width of them, pixels."""

    def _alter(self, world: AlterableWorld) -> None:
        world.add_filter(_still_images(world, self.cameras, (self.height, self.width)))


@dataclass(frozen=True)
class SwapImages(Indivisible, FilterChange):
    """Show the first images of another task from now on: its scene, settled, before any action."""

    operation: ClassVar[str] = "swap_images"

    cameras: _SomeCameras
    height: Positive
    """Height of the images that are kept, pixels."""
    width: Positive
    """Width of them, pixels."""
    suite: Text
    """The suite of the other task."""
    task_index: Count
    """Its position in the suite, from 0."""
    init_state_index: Count
    """Its initial state."""

    def _alter(self, world: AlterableWorld) -> None:
        scene = world.other_task(self.suite, self.task_index)
        scene.reset(self.init_state_index)
        for _ in range(SETTLE_STEPS):
            scene.step(scene.robot.noop)
        world.add_filter(_still_images(scene, self.cameras, (self.height, self.width)))
