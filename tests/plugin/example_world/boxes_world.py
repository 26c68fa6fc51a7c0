"""A benchmark of another kind: two suites, robots of four and six components at 10 Hz, other cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from pytest_libero_max import Case, Robot, SubstrateKind, SubstrateOptions, Suite
from tests.worlds.numpy_world import NumpyWorld

CAMERAS = ("overview", "palm")
FLOATER = Robot(
    name="floater",
    noop=(0.0, 0.0, 0.0, -1.0),
    control_hz=10,
    cameras=CAMERAS,
    state={"palm_eef_pos": 3, "palm_joints": 3, "palm_opening": 1},
    joints_key="palm_joints",
    fingers_key="palm_opening",
)
TURNER = Robot(
    name="turner",
    noop=(0.0, 0.0, 0.0, 0.0, 0.0, -1.0),
    control_hz=10,
    cameras=CAMERAS,
    state={"palm_eef_pos": 3, "palm_eef_quat": 4, "palm_joints": 5, "palm_opening": 2},
    joints_key="palm_joints",
    fingers_key="palm_opening",
)
FOUR = Suite("boxes_four", 14, "boxes", "four")
SIX = Suite("boxes_six", 14, "boxes", "six")
_ROBOTS = MappingProxyType({"boxes_four": FLOATER, "boxes_six": TURNER})


class BoxesSubstrate:
    """One world for each suite."""

    name = "boxes"

    def __init__(self) -> None:
        self._worlds: dict[str, NumpyWorld] = {}

    def world(self, case: Case) -> NumpyWorld:
        if case.suite not in self._worlds:
            self._worlds[case.suite] = NumpyWorld(_ROBOTS[case.suite], f"boxes/{case.suite}")
        return self._worlds[case.suite]

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {"substrate": self.name, "boxes": "1.0"}

    def close(self) -> None:
        self._worlds.clear()


def _examples(options: SubstrateOptions) -> Sequence[Case]:
    """Return the events of its first suite, spelled out as in a manifest."""
    from pytest_libero_max import load_manifest

    return load_manifest(Path("boxes.json")).cases


KIND = SubstrateKind(
    "boxes",
    lambda options: BoxesSubstrate(),
    suites=tuple(_ROBOTS),
    examples=_examples,
    control_hz=FLOATER.control_hz,
    note="Measured on boxes.",
    comparable_with_published=None,
)
