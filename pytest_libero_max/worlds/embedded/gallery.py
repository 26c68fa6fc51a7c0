"""A contact sheet of the embedded scenes, for people to look at."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.embedded.scene import build_scene
from pytest_libero_max.worlds.embedded.tasks import SUITES, Task, tasks

_CAPTION = 16
_INK, _PAPER = (40, 40, 40), (255, 255, 255)
# Colours are rounded to multiples of this, which nobody sees and which makes the file a third smaller.
_COLOUR_STEP = 4


def write_contact_sheet(
    path: Path,
    *,
    rows: Iterable[Task] | None = None,
    init: int = 0,
    camera: str = "agentview",
    size: int = 224,
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
    import cv2

    from pytest_libero_max.worlds.embedded.substrate import EmbeddedWorld

    chosen = [task for suite in SUITES for task in tasks(suite)] if rows is None else list(rows)
    pictures = []
    for task in chosen:
        world = EmbeddedWorld(build_scene(task.suite, task.index))
        try:
            world.reset(init)
            image = world.observe((camera,), size)[f"{camera}_image"][::-1]
        finally:
            world.close()
        pictures.append(_captioned(image, f"{task.suite}/{task.index}", _short(task)))
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % columns)
    sheet = np.vstack([np.hstack(pictures[n : n + columns]) for n in range(0, len(pictures), columns)])
    rounded = np.minimum(np.round(sheet / _COLOUR_STEP) * _COLOUR_STEP, 255).astype(np.uint8)
    _, encoded = cv2.imencode(".png", rounded[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encoded.tobytes())


def _short(task: Task) -> str:
    """The part of an instruction that tells it from the others of its suite."""
    words = task.language.removeprefix("pick up the ").removeprefix("black bowl ")
    return words.split(" and place it ")[0]


def _captioned(image: Image, key: str, words: str) -> Image:
    import cv2

    strip = np.full((_CAPTION * 2, image.shape[1], 3), _PAPER, np.uint8)
    for line, text in enumerate((key, words)):
        place = (3, _CAPTION * line + 12)
        cv2.putText(strip, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.33, _INK, 1, cv2.LINE_AA)
    framed = np.vstack([strip, image])
    framed[:, -1] = _PAPER
    return framed
