"""The images of a pair, kept by the state of the world that they show: no state is drawn twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pytest_libero_max.worlds.contract import Image, ImageSize, Observation, World

KEPT_BYTES = 2**26
"""Memory for the images of a pair, of which the oldest go first: two cameras of 170 queries at 256 pixels."""


@dataclass(frozen=True)
class KeptImages:
    """The last images of one world, by its digest: equal digests show the same."""

    _images: dict[tuple[bytes, tuple[str, ...], ImageSize], dict[str, Image]] = field(default_factory=dict)

    def observe(self, world: World, cameras: Sequence[str], size: ImageSize) -> Observation:
        """Return what :meth:`.World.observe` would, freshly allocated; what is known is not drawn again."""
        if not cameras:
            return world.observe((), size)
        key = (world.digest(), tuple(cameras), size)
        if key in self._images:
            images = self._images[key]
            return {**world.observe((), size), **{name: image.copy() for name, image in images.items()}}
        observation = world.observe(cameras, size)
        names = [f"{camera}_image" for camera in cameras]
        images = self._images[key] = {name: observation[name].copy() for name in names}
        room = max(1, KEPT_BYTES // sum(image.nbytes for image in images.values()))
        while len(self._images) > room:
            del self._images[next(iter(self._images))]
        return observation
