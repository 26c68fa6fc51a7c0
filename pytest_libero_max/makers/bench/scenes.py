"""Cost of each scene: building its model, stepping it, drawing it."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from statistics import median

import numpy as np

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.makers.bench.clock import processor_seconds
from pytest_libero_max.substrates.contract import Substrate
from pytest_libero_max.tasks.libero_tasks import tasks
from pytest_libero_max.tasks.suites import LIBERO_SUITES
from pytest_libero_max.worlds.contract import World
from pytest_libero_max.worlds.robot import ACTION_DIM, CAMERAS

OpenScene = Callable[[str, int], AbstractContextManager[World]]
"""Makes the world of a task, by suite and number, and closes it."""

SCENES = sum(len(tasks(suite)) for suite in LIBERO_SUITES)
"""Sizes of the samples of :func:`measure_scenes`."""

_WARM_UP = 3


@dataclass(frozen=True)
class SceneCost:
    """Processor times of one scene."""

    scene: str
    build_s: float
    """Making the world: model, robot, first initial state."""
    step_ms: float
    """Median of a control step with random actions."""
    first_image_s: float
    """The first image, for which textures and meshes are uploaded."""
    image_ms: float
    """Median of a later image, over both cameras."""


def scenes_of(substrate: Substrate) -> OpenScene:
    """Return a function that opens the worlds of LIBERO's own tasks, one at a time."""
    cases = {(case.suite, case.task_index): case for case in load_track("original")}

    @contextmanager
    def open_scene(suite: str, index: int) -> Iterator[World]:
        try:
            yield substrate.world(cases[suite, index])
        finally:
            substrate.close()
            gc.collect()  # an environment refers to itself, and a genuine one holds most of a gigabyte

    return open_scene


def measure_scenes(
    open_scene: OpenScene, *, steps: int = 40, images: int = 10, size: int = 256
) -> Iterator[SceneCost]:
    """Measure all forty, one after the other: control steps, and images from the two cameras in turns."""
    measure_scene(open_scene, LIBERO_SUITES[0], 0, 1, 1, size)  # compiles the loop, opens the driver
    for suite in LIBERO_SUITES:
        for task in tasks(suite):
            yield measure_scene(open_scene, suite, task.index, steps, images, size)


def measure_scene(
    open_scene: OpenScene, suite: str, index: int, steps: int, images: int, size: int
) -> SceneCost:
    """Measure one; see :func:`measure_scenes`."""
    with ExitStack() as opened:
        begin = time.process_time()
        world = opened.enter_context(open_scene(suite, index))
        build_s = time.process_time() - begin
        actions = np.random.default_rng(0).uniform(-1.0, 1.0, (_WARM_UP + steps, ACTION_DIM))
        step_s = [processor_seconds(world.step, action) for action in actions]
        first_s = processor_seconds(world.observe, CAMERAS[:1], size)
        image_s = [
            processor_seconds(world.observe, CAMERAS[number % 2 :][:1], size)
            for number in range(_WARM_UP + images)
        ]
    return SceneCost(
        scene=f"{suite}/{index}",
        build_s=build_s,
        step_ms=1000 * median(step_s[_WARM_UP:]),
        first_image_s=first_s,
        image_ms=1000 * median(image_s[_WARM_UP:]),
    )


def cost_lines(costs: list[SceneCost]) -> list[str]:
    """Return a table for people: Markdown, and the extremes against the median."""
    heads = ("scene", "build, s", "step, ms", "steps/s", "first image, s", "image, ms")
    lines = [f"| {' | '.join(heads)} |", f"| --- |{' ---: |' * (len(heads) - 1)}"]
    for cost in costs:
        steps = f"{cost.build_s:.2f} | {cost.step_ms:.2f} | {1000 / cost.step_ms:.0f}"
        lines.append(f"| {cost.scene} | {steps} | {cost.first_image_s:.2f} | {cost.image_ms:.1f} |")
    middle = median(cost.image_ms for cost in costs)
    most = max(costs, key=lambda cost: cost.image_ms)
    step, build = median(cost.step_ms for cost in costs), median(cost.build_s for cost in costs)
    first = median(cost.first_image_s for cost in costs)
    lines += [
        "",
        f"Median image {middle:.1f} ms; {most.scene} takes longest, {most.image_ms / middle:.2f} times that. "
        f"Median step {step:.2f} ms, median build {build:.2f} s, median first image {first:.2f} s. "
        "Processor times.",
    ]
    return lines
