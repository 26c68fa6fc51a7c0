"""Genuine images with everything drawn and with only what they show, side by side and compared bit for bit.

    python -m tests.scripts.measure_images images.tsv

In each scene a case of each of the eight events begins, the hand moves a little, and three cameras look
before the event and after it. At last the stove and a camera are moved and an object is taken out. The file
has a line for each image; a scene that it has is not measured again. Processor time, medians.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import cut_torn_line
from pytest_libero_max.events.kind import VARIANTS
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.events.schedules import change_of
from pytest_libero_max.pairing.changing import apply_change, begin_world
from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.tasks.libero_tasks import SUITES
from pytest_libero_max.worlds.contract import CAMERAS

LOOKED_THROUGH = (*CAMERAS, "frontview")
BEFORE, AFTER = "before", "after"
ALTERED = "stove, camera, object"
"""Name of what is done at last, which is none of the eight events."""

_STEPS = 6
"""Control steps at random before an event."""


class Drawn(NamedTuple):
    """One image, drawn twice.

    Attributes:
        scene: Suite and task.
        mirror: ``mirror`` or ``no mirror``.
        event: Name of the event.
        when: Before it or after it.
        camera: Name of the camera.
        plain_ms: Processor time with everything drawn.
        thrifty_ms: Processor time with what the image shows.
        unequal: Number of bytes that differ.
    """

    scene: str
    mirror: str
    event: str
    when: str
    camera: str
    plain_ms: float
    thrifty_ms: float
    unequal: int


def cases_of(suite: str, task: int, events: Sequence[str]) -> Iterator[Case]:
    """Yield the cases of a scene: those events that it can host, from different states, variants in turn."""
    for number, event in enumerate(events):
        if eligible(event, task_metadata(suite, task)):
            yield make_case(event, suite, task, number, variant=VARIANTS[(task + number) % 2])


def measure(
    substrate: LiberoSubstrate, suite: str, task: int, size: int, events: Sequence[str] = BENCHMARK_EVENTS
) -> Iterator[Drawn]:
    """Yield every image of a scene."""
    rng = np.random.default_rng(task)
    for case in cases_of(suite, task, events):
        world = substrate.world(case)
        begin_world(case, world)
        for _ in range(_STEPS):
            world.step((*rng.uniform(-1, 1, 2), rng.uniform(-1, 0.2), 0, 0, 0, 1))
        yield from look(world, f"{suite}/{task}", case.event.name, BEFORE, size)
        apply_change(change_of(case), world, None, case.item_id)
        yield from look(world, f"{suite}/{task}", case.event.name, AFTER, size)
    alter(world)
    yield from look(world, f"{suite}/{task}", ALTERED, AFTER, size)


def look(world: LiberoWorld, scene: str, event: str, when: str, size: int) -> Iterator[Drawn]:
    """Draw the images of all cameras with everything and with what they show."""
    world.observe(CAMERAS[:1], 16)  # uploads, and brings the view up to date
    renderer = world._renderer
    assert renderer is not None
    mirror = "mirror" if any("stove" in name for name in world.entities) else "no mirror"
    for camera in LOOKED_THROUGH:
        times, images = [], []
        for renderer.thrifty in (False, True):
            begin = process_time()
            images.append(renderer.render(camera, size))
            times.append(round(1e3 * (process_time() - begin), 2))
        unequal = np.count_nonzero(images[0] != images[1])
        yield Drawn(scene, mirror, event, when, camera, times[0], times[1], unequal)


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


def read(path: Path) -> list[Drawn]:
    """Return what a file has; one without any where there is none."""
    if not path.exists():
        return []
    cut_torn_line(path)
    kinds = (*[str] * 5, float, float, int)
    rows = (line.split("\t") for line in path.read_text().splitlines())
    return [Drawn._make(kind(cell) for kind, cell in zip(kinds, row, strict=True)) for row in rows]


def tables(drawn: list[Drawn]) -> Iterator[str]:
    """Yield the lines of two tables: equal images by event and camera, and times by suite and camera."""
    for event in (*BENCHMARK_EVENTS, ALTERED):
        for when in (BEFORE, AFTER):
            cells = []
            for camera in LOOKED_THROUGH:
                images = [one for one in drawn if (one.event, one.when, one.camera) == (event, when, camera)]
                cells.append(f"{sum(not one.unequal for one in images)} of {len(images)}")
            scenes = len({one.scene for one in drawn if (one.event, one.when) == (event, when)})
            if scenes:
                yield f"| {event}, {when} | {scenes} | {' | '.join(cells)} |"
    yield ""
    groups: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    for one in drawn:
        for name in (one.scene.partition("/")[0], "all"):
            groups.setdefault((name, one.mirror, one.camera), []).append((one.plain_ms, one.thrifty_ms))
    for group, pairs in groups.items():
        plain, thrifty = np.median(np.array(pairs), axis=0)
        yield f"| {' | '.join(group)} | {plain:.1f} | {thrifty:.1f} | {plain / thrifty:.2f} |"
    yield f"{len(drawn)} images, {sum(one.unequal > 0 for one in drawn)} unequal"


def main() -> None:
    """Read the command line, measure the scenes that the file lacks, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path, help="file of the images, which need not exist")
    parser.add_argument(
        "--assets", type=Path, help="assets of the installation, where it has none of its own"
    )
    parser.add_argument("--suites", nargs="+", default=SUITES)
    parser.add_argument("--tasks", nargs="+", type=int, default=range(10), help="default: all ten")
    parser.add_argument("--size", type=int, default=256, help="side of an image, pixels (default 256)")
    options = parser.parse_args()
    known = {one.scene for one in read(options.file)}
    installation = find_installation(assets=options.assets)
    for suite, task in product(options.suites, options.tasks):
        if f"{suite}/{task}" in known:
            continue
        substrate = LiberoSubstrate([installation])
        rows = list(measure(substrate, suite, task, options.size))
        substrate.close()
        with options.file.open("a") as file:  # at once, so that a scene is there as a whole or not at all
            file.write("".join("\t".join(map(str, row)) + "\n" for row in rows))
    print("\n".join(tables(read(options.file))))


if __name__ == "__main__":
    main()
