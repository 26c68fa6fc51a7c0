"""Images by the second: what the device that draws gives one process, and several at once."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pytest_libero_max.makers.bench.clock import in_processes, wait_for_others
from pytest_libero_max.makers.bench.scenes import scenes_of
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.worlds.contract import Image, World
from pytest_libero_max.worlds.rendering import egl, gl
from pytest_libero_max.worlds.rendering.renderer import Renderer
from pytest_libero_max.worlds.robot import ACTION_DIM, CAMERAS

_WARM_UP = 6
_LOOKS, _STEPS = 6, 5
"""Times that a scene is looked at to compare its images, and control steps before each."""


@dataclass(frozen=True)
class ImageRate:
    """Images of one scene, drawn by several processes at once."""

    scene: str
    """For example ``libero_spatial/0``."""
    processes: int
    images: int
    seconds: float

    @property
    def images_per_s(self) -> float:
        """Images a second, of all processes together."""
        return self.images / self.seconds

    @property
    def image_ms(self) -> float:
        """Wall-clock time of one image in its process."""
        return 1000 * self.seconds * self.processes / self.images


def device() -> str:
    """Return what draws, for people."""
    backend = gl.require()
    return f"{backend}, {egl.chosen()[0]}" if backend == "egl" else backend


def measure_rates(
    name: str,
    options: SubstrateOptions,
    scenes: Sequence[tuple[str, int]],
    processes: Sequence[int],
    *,
    seconds: float = 5.0,
    size: int = 256,
) -> Iterator[ImageRate]:
    """Draw each scene for some seconds with each number of processes, one after the other.

    Between two images the world takes a step, as in an episode, so that no picture is drawn twice; its
    time is not counted.
    """
    for suite, index in scenes:
        for number in processes:
            counts = in_processes(number, _draw, name, options, suite, index, seconds, size)
            drawn, took = sum(count for count, _ in counts), sum(spent for _, spent in counts)
            yield ImageRate(f"{suite}/{index}", number, drawn, took / number)


def _draw(
    name: str, options: SubstrateOptions, suite: str, index: int, seconds: float, size: int
) -> tuple[int, float]:
    """Return the images that this process drew, from both cameras in turns, and the seconds they took."""
    with scenes_of(open_substrate(name, options))(suite, index) as world:
        for number in range(_WARM_UP):
            world.observe(CAMERAS[number % 2 :][:1], size)
        wait_for_others()
        count, spent, end = 0, 0.0, time.perf_counter() + seconds
        while time.perf_counter() < end:
            world.step([0.0] * ACTION_DIM)
            begin = time.perf_counter()
            world.observe(CAMERAS[count % 2 :][:1], size)
            spent += time.perf_counter() - begin
            count += 1
        return count, spent


@dataclass(frozen=True)
class SameImages:
    """Equality of the images of one scene, bit for bit."""

    scene: str
    """For example ``libero_spatial/0``."""
    images: int
    unequal: int
    """Number of them that differ where everything is drawn, also what no pixel shows."""
    repeated: bool
    """True if another process draws all of them alike."""


def compare_images(
    name: str, options: SubstrateOptions, scenes: Sequence[tuple[str, int]], *, size: int = 256
) -> Iterator[SameImages]:
    """Compare images with those where everything is drawn, and with those of another process."""
    for suite, index in scenes:
        (unequal, digests), (_, repeated) = in_processes(2, _compare, name, options, suite, index, size)
        yield SameImages(f"{suite}/{index}", len(digests), unequal, digests == repeated)


def _compare(
    name: str, options: SubstrateOptions, suite: str, index: int, size: int
) -> tuple[int, list[str]]:
    """Return the number of images that differ where everything is drawn, and the digests of all images."""
    random = np.random.default_rng(0)
    unequal, digests = 0, []
    with scenes_of(open_substrate(name, options))(suite, index) as world:
        for _ in range(_LOOKS):
            for _ in range(_STEPS):
                world.step(random.uniform(-1, 1, ACTION_DIM).tolist())
            images = _images(world, size)
            renderer = getattr(world, "_renderer", None)
            if isinstance(renderer, Renderer):
                thrifty, renderer.thrifty = renderer.thrifty, False
                full = _images(world, size)
                renderer.thrifty = thrifty
                unequal += sum(a.tobytes() != b.tobytes() for a, b in zip(images, full, strict=True))
            digests += [hashlib.sha256(image.tobytes()).hexdigest() for image in images]
    return unequal, digests


def _images(world: World, size: int) -> list[Image]:
    seen = world.observe(CAMERAS, size)
    return [seen[f"{camera}_image"] for camera in CAMERAS]


def same_lines(results: Sequence[SameImages]) -> list[str]:
    """Return a table in Markdown."""
    return [
        "| scene | images | unequal to those with everything drawn | the same in another process |",
        "| --- | ---: | ---: | --- |",
        *(
            f"| {result.scene} | {result.images} | {result.unequal} | {'yes' if result.repeated else 'no'} |"
            for result in results
        ),
    ]


def rate_lines(rates: Sequence[ImageRate]) -> list[str]:
    """Return a table in Markdown."""
    return [
        "| scene | processes | images/s, all | ms an image |",
        "| --- | ---: | ---: | ---: |",
        *(
            f"| {rate.scene} | {rate.processes} | {rate.images_per_s:.0f} | {rate.image_ms:.1f} |"
            for rate in rates
        ),
    ]
