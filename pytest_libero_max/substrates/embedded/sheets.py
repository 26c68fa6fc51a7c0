"""A contact sheet of the embedded scenes, for people to look at."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.tasks.libero_tasks import SUITES, Task, tasks
from pytest_libero_max.worlds.rendering.sheets import captioned, wrapped, write_sheet


def write_contact_sheet(
    path: Path,
    *,
    rows: Iterable[Task] | None = None,
    init: int = 0,
    camera: str = "agentview",
    size: int = 184,
    columns: int = 5,
) -> None:
    """Render scenes at reset, with the robot, upright and captioned, into one PNG.

    Args:
        path: The file to write.
        rows: The tasks to show; every task that has an embedded scene by default.
        init: Initial state.
        camera: Any camera of the scenes.
        size: Side of one picture in pixels.
        columns: Pictures in a row.
    """
    from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld

    chosen = [task for suite in SUITES for task in tasks(suite)] if rows is None else list(rows)
    captions = [[f"{task.suite}/{task.index}", *wrapped(_short(task), size)] for task in chosen]
    pictures = []
    for number, task in enumerate(chosen):
        world = EmbeddedWorld(build_scene(task.suite, task.index))
        try:
            world.reset(init)
            image = world.observe((camera,), size)[f"{camera}_image"][::-1]
        finally:
            world.close()
        caption = captions[number]
        lines = max(len(other) for other in captions)
        pictures.append(captioned(image, *caption, *[""] * (lines - len(caption))))
    write_sheet(path, pictures, columns)


def _short(task: Task) -> str:
    """The part of an instruction that tells it from the others of its suite."""
    if task.suite not in ("libero_spatial", "libero_object"):
        return task.language
    words = task.language.removeprefix("pick up the ").removeprefix("black bowl ")
    return words.split(" and place it ")[0]
