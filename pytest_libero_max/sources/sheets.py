"""Contact sheets of the source variations, for people to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from pytest_libero_max.sources.counts import CATEGORIES
from pytest_libero_max.sources.plus import plus_suite
from pytest_libero_max.sources.pro import CATEGORIES as PRO_CATEGORIES
from pytest_libero_max.sources.pro import pro_suite
from pytest_libero_max.sources.variation import Variation
from pytest_libero_max.worlds.contract import NOOP_ACTION, Image
from pytest_libero_max.worlds.embedded.substrate import EmbeddedSubstrate

PLUS_LEVELS = (1, 3, 5)

_CAMERA = "agentview"
_STEPS = 10
_CAPTION_PX = 13
# Noise and textures do not compress; nobody misses the last three bits of a thumbnail.
_COLOUR_STEP = 8


def write_plus_sheet(
    path: Path,
    substrate: EmbeddedSubstrate,
    *,
    picks: Sequence[tuple[str, int]] = (("libero_spatial", 0), ("libero_object", 3)),
    size: int = 144,
) -> None:
    """Each category of LIBERO-Plus at levels 1, 3 and 5, on each of some tasks, into one PNG.

    Args:
        path: The file to write.
        substrate: Builds the worlds.
        picks: Suites and indices of unmodified tasks. Where a task has no variation of a level, another task
            of its suite stands in.
        size: Side of one picture in pixels.
    """
    rows = [
        [_nearest(suite, index, category, level) for suite, index in picks for level in PLUS_LEVELS]
        for category in CATEGORIES
    ]
    _write(path, substrate, rows, size)


def write_pro_sheet(
    path: Path,
    substrate: EmbeddedSubstrate,
    *,
    picks: Sequence[tuple[str, int]] = (
        ("libero_spatial", 0),
        ("libero_object", 3),
        ("libero_goal", 8),
        ("libero_10", 9),
    ),
    columns: int = 5,
    size: int = 144,
) -> None:
    """Each category of LIBERO-PRO on each of some tasks, into one PNG; arguments as above."""
    chosen = [pro_suite(category, suite)[index] for suite, index in picks for category in PRO_CATEGORIES]
    rows = [chosen[start : start + columns] for start in range(0, len(chosen), columns)]
    _write(path, substrate, rows, size)


def _nearest(suite: str, index: int, category: str, level: int) -> Variation:
    """A variation of that level, of the task if it has one, in the middle of those there are."""
    found = [one for one in plus_suite(suite) if (one.category, one.difficulty) == (category, level)]
    own = [one for one in found if one.base_index == index] or found
    return own[len(own) // 2]


def _write(path: Path, substrate: EmbeddedSubstrate, rows: Iterable[Sequence[Variation]], size: int) -> None:
    import cv2

    lines = []
    for row in rows:
        lines.append(np.hstack([_picture(substrate, variation, size) for variation in row]))
    width = max(line.shape[1] for line in lines)
    padded = [
        np.pad(line, ((0, 0), (0, width - line.shape[1]), (0, 0)), constant_values=255) for line in lines
    ]
    sheet = np.vstack(padded)
    rounded = np.minimum(np.round(sheet / _COLOUR_STEP) * _COLOUR_STEP, 255).astype(np.uint8)
    _, encoded = cv2.imencode(".png", rounded[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encoded.tobytes())


def _picture(substrate: EmbeddedSubstrate, variation: Variation, size: int) -> Image:
    import cv2

    world = substrate.varied_world(variation)
    world.reset(0)
    for _ in range(_STEPS):
        world.step(NOOP_ACTION)
    image = world.observe((_CAMERA,), 256)[f"{_CAMERA}_image"][::-1]
    small = cv2.resize(image, (size, size), interpolation=cv2.INTER_AREA)
    level = "" if variation.difficulty is None else f" {variation.difficulty}"
    lines = [f"{variation.category}{level}", *_wrapped(world.language, size // 5)[:3]]
    strip = np.full((_CAPTION_PX * 4, size, 3), 255, np.uint8)
    for number, text in enumerate(lines):
        place = (2, _CAPTION_PX * number + 9)
        cv2.putText(strip, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.28, (30, 30, 30), 1, cv2.LINE_AA)
    framed: Image = np.vstack([strip, small])
    framed[:, -1] = 255
    return framed


def _wrapped(text: str, width: int) -> list[str]:
    import textwrap

    return textwrap.wrap(text, width)
