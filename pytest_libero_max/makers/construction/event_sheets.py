"""Contact sheet of the events: each camera's image just before and just after each event."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli.case_text import event_pictures
from pytest_libero_max.events.approach import approach
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.substrates.contract import Substrate
from pytest_libero_max.worlds.contract import Image, World
from pytest_libero_max.worlds.rendering.appearance import MOVED_M, Points, outlines, places_of
from pytest_libero_max.worlds.rendering.contact_sheets import captioned, write_sheet
from pytest_libero_max.worlds.robot import CAMERAS

ORIGINAL = "original"
"""The track on LIBERO's own tasks."""

_PAIRS_A_ROW = 2
_INK, _OLD_PLACE = (31, 41, 51), (255, 212, 71)
_PAGE_PX = 128
"""Side of a picture on a page of a report."""


def write_event_sheet(path: Path, substrate: Substrate, track: str = ORIGINAL, size: int = 160) -> None:
    """Render a case of a track for each event variant before and after it, and write one file.

    A row is an event. Each variant has four pictures side by side: the agent's view before and after, the
    wrist's before and after. What the event moved is outlined where it was, with an arrow to where it is. Of
    two sources, the first variant shows the first one, and the second variant the other.
    """
    pictures: list[Image] = []
    for name, seen in _seen(substrate, size, track):
        pictures += [
            captioned(
                picture,
                name.replace("-v", ", variant ") if (camera, label) == (CAMERAS[0], "before") else "",
                f"{label}, {camera}",
            )
            for camera, both in seen.items()
            for label, picture in zip(("before", "after"), both, strict=True)
        ]
    write_sheet(path, pictures, columns=4 * _PAIRS_A_ROW)


def write_page_pictures(folder: Path, substrate: Substrate, track: str = ORIGINAL) -> None:
    """Write the same for pages of reports: one small file a variant, called like ``camera_shift-v1.webp``."""
    for name, seen in _seen(substrate, _PAGE_PX, track):
        pictures = [picture for both in seen.values() for picture in both]
        write_sheet(folder / f"{name}.webp", pictures, columns=len(pictures), colour_step=1)


def _seen(
    substrate: Substrate, size: int, track: str = ORIGINAL
) -> Iterator[tuple[str, dict[str, tuple[Image, Image]]]]:
    """Pictures of each camera before and after each event variant, which is named first."""
    cases = {(case.source, case.event.name, case.event.variant): case for case in load_track(track)}
    sources = sorted({source for source, _, _ in cases})
    for name in BENCHMARK_EVENTS:
        for variant in (0, 1):
            case = cases[sources[-variant], name, variant]
            world = substrate.world(case)
            approach(world, case)
            before = places_of(world)
            pictures = event_pictures(world, case, size)
            ways = [(before[name], place) for name, place in places_of(world).items() if name in before]
            moved = [way for way in ways if len(way[0]) and np.abs(way[1] - way[0]).max() > MOVED_M]
            yield (
                f"{name}-v{variant}",
                {
                    camera: (then, _with_arrows(now, world, camera, moved))
                    for camera, (then, now) in pictures.items()
                },
            )


def _with_arrows(image: Image, world: World, camera: str, moved: Sequence[tuple[Points, Points]]) -> Image:
    import cv2

    drawn = np.ascontiguousarray(image)
    for way in moved:
        seen = [outlines([place], world, {camera: image}).get(camera) for place in way]
        if seen[0] is None or seen[1] is None:
            continue
        corners = [position[0] for position in seen if position is not None]
        begin, end = (tuple(int(value) for value in position.mean(axis=0).round()) for position in corners)
        for color, width in ((_INK, 3), (_OLD_PLACE, 1)):
            cv2.polylines(drawn, [corners[0]], True, color, width, cv2.LINE_AA)
            cv2.arrowedLine(drawn, begin, end, color, width, cv2.LINE_AA, tipLength=0.25)
    return drawn
