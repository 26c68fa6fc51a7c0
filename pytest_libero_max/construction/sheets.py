"""Contact sheet of the events: each camera's image just before and just after each event."""

from __future__ import annotations

from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.construction.case_text import event_pictures
from pytest_libero_max.construction.preflight import approach
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.worlds.contract import CAMERAS, Image, Substrate, World
from pytest_libero_max.worlds.rendering.sheets import captioned, write_sheet

_PAIRS_A_ROW = 2


def write_event_sheet(path: Path, substrate: Substrate, size: int = 160) -> None:
    """Render a case of the original track for each event variant before and after it, and write one file.

    Each variant has four pictures side by side: the agent's view before and after, the wrist's before and
    after.

    Args:
        path: The file to write.
        substrate: What builds the worlds.
        size: Side of one picture in pixels.
    """
    cases = {(case.event.name, case.event.variant): case for case in load_track("original")}
    pictures: list[Image] = []
    for name in BENCHMARK_EVENTS:
        for variant in (0, 1):
            case = cases[name, variant]
            pictures += _before_and_after(substrate.world(case), case, size)
    write_sheet(path, pictures, columns=4 * _PAIRS_A_ROW)


def _before_and_after(world: World, case: Case, size: int) -> list[Image]:
    approach(world, case)
    title = f"{case.event.name} v{case.event.variant}"
    return [
        captioned(picture, title if camera == CAMERAS[0] else "", f"{label}, {camera}")
        for camera, pictures in event_pictures(world, case, size).items()
        for label, picture in zip(("before", "after"), pictures, strict=True)
    ]
