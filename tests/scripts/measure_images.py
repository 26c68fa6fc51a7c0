"""Genuine images with everything drawn and with only what they show, side by side and compared bit for bit.

    python -m tests.scripts.measure_images --assets FOLDER

Each scene is looked at along random actions; then its stove and its camera are moved and an object is taken
out. Processor time, the medians of all images of a suite.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import numpy as np

from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.worlds.contract import CAMERAS
from pytest_libero_max.worlds.rendering.renderer import Renderer

_STEPS = 5
"""Control steps between two looks."""


def measure(world: LiberoWorld, size: int, looks: int) -> Iterator[tuple[str, float, float, bool]]:
    """Yield for each image: camera, seconds with everything drawn, seconds with what it shows, equal bits."""
    rng = np.random.default_rng(0)
    world.reset(0)
    world.observe(size=size)
    renderers = [Renderer(world.model, world._view, True, thrifty=thrifty) for thrifty in (False, True)]
    for number in range(looks):
        for _ in range(_STEPS):
            world.step((*rng.uniform(-1, 1, 2), rng.uniform(-1, 0.2), 0, 0, 0, 1))
        if number == looks // 2:
            alter(world)
        world.observe(CAMERAS[:1], 16)  # brings the view up to date
        for camera in CAMERAS:
            seconds, images = [], []
            for renderer in renderers:
                begin = process_time()
                images.append(renderer.render(camera, size))
                seconds.append(process_time() - begin)
            if number:  # the first one uploads
                yield camera, seconds[0], seconds[1], np.array_equal(*images)
    for renderer in renderers:
        renderer.close()


def alter(world: LiberoWorld) -> None:
    """Move the stove and the camera, and take an object out."""
    for name in world.entities:
        if "stove" in name:
            position = world.position(name) + np.array([0.1, -0.1, 0.03])
            world.place(name, position, (0.97, 0.03, 0.02, 0.2404))
    camera = world.model.camera("agentview").id
    world.alter("cam_pos", camera, world.model.cam_pos[camera] + np.array([0.1, 0.15, -0.1]))
    first = next(name for name, entity in world.entities.items() if entity.kind == "object")
    world.park(first, (0.0, 0.0, -5.0))


def main() -> None:
    """Read the command line and print a line for each scene, and one for each suite and camera."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--assets", type=Path, help="assets of the installation, where it has none of its own"
    )
    parser.add_argument(
        "--suites", nargs="+", default=["libero_spatial", "libero_object", "libero_goal", "libero_10"]
    )
    parser.add_argument("--tasks", nargs="+", type=int, default=range(10), help="default: all ten")
    parser.add_argument("--looks", type=int, default=9, help="times that a scene is looked at (default 9)")
    parser.add_argument("--size", type=int, default=256, help="side of an image, pixels (default 256)")
    options = parser.parse_args()
    installation = find_installation(assets=options.assets)
    unequal = count = 0
    groups: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    for suite, task in ((suite, task) for suite in options.suites for task in options.tasks):
        substrate = LiberoSubstrate([installation])
        world = substrate.task_world(suite, task, 0)
        mirror = "mirror" if any("stove" in name for name in world.entities) else "no mirror"
        for camera, plain, thrifty, equal in measure(world, options.size, options.looks):
            count, unequal = count + 1, unequal + (not equal)
            for group in ((f"{suite}/{task}", camera), (suite, mirror, camera), ("all", mirror, camera)):
                groups.setdefault(group, []).append((plain, thrifty))
        substrate.close()
    for group, pairs in groups.items():
        plain, thrifty = 1e3 * np.median(np.array(pairs), axis=0)
        print(f"| {' | '.join(group)} | {plain:.1f} | {thrifty:.1f} | {plain / thrifty:.2f} |")
    print(f"{count} images, {unequal} unequal")


if __name__ == "__main__":
    main()
