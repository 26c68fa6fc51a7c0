"""Contact sheets of the embedded scenes and of their source variations, for people to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.embedded.catalogue.plus_catalogue import plus_suite
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import pro_suite
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate, EmbeddedWorld
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.libero_tasks import SUITES, Task, tasks
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES, PRO_CATEGORIES
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rendering.contact_sheets import captioned, resized, wrapped, write_sheet
from pytest_libero_max.worlds.robot import NOOP_ACTION

PLUS_LEVELS = (1, 3, 5)
PLUS_TASKS = (("libero_spatial", 0), ("libero_object", 3))
"""Suites and indices of the tasks whose variations are shown."""
PRO_TASKS = (*PLUS_TASKS, ("libero_goal", 8), ("libero_10", 9))

_CAMERA = "agentview"
_STEPS = 10
_IMAGES = SubstrateOptions().for_people().images
# Noise and textures hardly compress; in a picture this small, the last three bits do not show.
_COLOUR_STEP = 8

Captioned = tuple[list[str], Image]
"""Lines of a caption, and the picture."""


def write_scenes(path: Path, rows: Iterable[Task] | None = None, size: int = 184, columns: int = 10) -> None:
    """Render scenes at reset, with the robot, upright and captioned, into one PNG.

    Args:
        rows: The tasks to show; every task that has an embedded scene by default.
        size: Side of one picture in pixels.
    """
    shown: list[Captioned] = []
    for task in [task for suite in SUITES for task in tasks(suite)] if rows is None else rows:
        world = EmbeddedWorld(build_scene(task.suite, task.index), images=_IMAGES)
        image = world.observe((_CAMERA,), size)[f"{_CAMERA}_image"][::-1]
        world.close()
        shown.append(([f"{task.suite}/{task.index}", *wrapped(_short(task), size)], image))
    _write(path, shown, columns)


def _short(task: Task) -> str:
    """Return the part of an instruction that tells it from the others of its suite."""
    if task.suite not in ("libero_spatial", "libero_object"):
        return task.language
    words = task.language.removeprefix("pick up the ").removeprefix("black bowl ")
    return words.split(" and place it ")[0]


def write_plus(path: Path, substrate: EmbeddedSubstrate, size: int = 144) -> None:
    """Render each category of LIBERO-Plus at some levels, on each of some tasks, into one PNG."""
    chosen = [
        _nearest(suite, index, category, level)
        for category in PLUS_CATEGORIES
        for suite, index in PLUS_TASKS
        for level in PLUS_LEVELS
    ]
    shown = [_picture(substrate, variation, size) for variation in chosen]
    _write(path, shown, len(PLUS_TASKS) * len(PLUS_LEVELS), _COLOUR_STEP)


def write_pro(
    path: Path,
    substrate: EmbeddedSubstrate,
    picks: Sequence[tuple[str, int]] = PRO_TASKS,
    columns: int = 5,
    size: int = 144,
) -> None:
    """Render each category of LIBERO-PRO on each of some tasks into one PNG."""
    chosen = [pro_suite(category, suite)[index] for suite, index in picks for category in PRO_CATEGORIES]
    _write(path, [_picture(substrate, variation, size) for variation in chosen], columns, _COLOUR_STEP)


def _nearest(suite: str, index: int, category: str, level: int) -> Variation:
    """Return a variation of that level, of the task if it has one, in the middle of those there are."""
    matches = [
        variation
        for variation in plus_suite(suite)
        if (variation.category, variation.difficulty) == (category, level)
    ]
    own = [variation for variation in matches if variation.base_index == index] or matches
    return own[len(own) // 2]


def _write(path: Path, shown: Sequence[Captioned], columns: int, colour_step: int = 4) -> None:
    pictures = []
    for first in range(0, len(shown), columns):
        row = shown[first : first + columns]
        lines = max(len(caption) for caption, _ in row)
        pictures += [captioned(image, *caption, *[""] * (lines - len(caption))) for caption, image in row]
    write_sheet(path, pictures, columns, colour_step=colour_step)


def _picture(substrate: EmbeddedSubstrate, variation: Variation, size: int) -> Captioned:
    """Return the whole caption of a variation and its picture."""
    world = substrate.varied_world(variation)
    world.reset(0)
    for _ in range(_STEPS):
        world.step(NOOP_ACTION)
    image = world.observe((_CAMERA,), 256)[f"{_CAMERA}_image"][::-1]
    level = "" if variation.difficulty is None else f", severity {variation.difficulty} of 5"
    title = f"{variation.category.replace('_', ' ')}{level}"
    return [*wrapped(title, size), *wrapped(world.language, size)], resized(image, size)
