"""Genuine images drawn with everything and with only what they show, compared bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.kind import VARIANTS
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.events.schedules import change_of
from pytest_libero_max.pairing.changing import apply_change, begin_world
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.worlds.robot import CAMERAS

LOOKED_THROUGH = (*CAMERAS, "frontview")
BEFORE, AFTER = "before", "after"
ALTERED = "stove, camera, object"
"""Name of what is done at last, which is none of the eight events."""

_STEPS = 6
"""Control steps at random before an event."""


class Drawn(NamedTuple):
    """One image, drawn twice."""

    event: str
    when: str
    """Before the event or after it."""
    camera: str
    unequal: int
    """Number of bytes that differ."""


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
        yield from look(world, case.event.name, BEFORE, size)
        apply_change(change_of(case), world, None, case.item_id)
        yield from look(world, case.event.name, AFTER, size)
    alter(world)
    yield from look(world, ALTERED, AFTER, size)


def look(world: LiberoWorld, event: str, when: str, size: int) -> Iterator[Drawn]:
    """Draw the images of all cameras with everything and with what they show."""
    world.observe(CAMERAS[:1], 16)  # uploads, and brings the view up to date
    renderer = world._renderer
    assert renderer is not None
    for camera in LOOKED_THROUGH:
        images = []
        for renderer.thrifty in (False, True):
            images.append(renderer.render(camera, size))
        yield Drawn(event, when, camera, int(np.count_nonzero(images[0] != images[1])))


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
