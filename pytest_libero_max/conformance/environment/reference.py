"""Recording of genuine LIBERO in one task, as a value that an environment is compared with.

A reference is recorded once, from a world (:mod:`.recording`), and read by processes that have neither LIBERO
nor its models. It holds the robot's state, small pictures and outcomes, and no initial state.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import Count, Document, Positive, Text, decode
from pytest_libero_max.errors import OptionError, ReportError, did_you_mean

REFERENCE_VERSION: Final = 1
"""Version of the document's form."""

FOLDER = Path(__file__).parent / "references"

SIDE = 32
"""Side of a small picture, pixels."""

Array = NDArray[np.float64]


class RobotState(Document, frozen=True, kw_only=True):
    """The robot's state in an observation, by LIBERO's conventions."""

    position: tuple[float, float, float]
    """Of the grip site, m, world."""
    quaternion: tuple[float, float, float, float]
    """Of the hand, xyzw, with the sign that is observed."""
    gripper: tuple[float, float]
    """Positions of the two finger joints, m."""
    joints: list[float]
    """Positions of the arm's joints, rad."""


class Move(Document, frozen=True, kw_only=True):
    """The way of the hand under the same action for some steps, from the settled state."""

    action: list[float]
    """(7,), repeated."""
    steps: Positive
    way: tuple[float, float, float]
    """Displacement of the grip site, m, world."""
    turn: tuple[float, float, float]
    """Rotation of the hand as axis times angle, rad, world."""


class TaskReference(Document, frozen=True, kw_only=True):
    """One task as genuine LIBERO plays it."""

    schema_version: Literal[1] = REFERENCE_VERSION
    """Version of this document's form."""
    task: Text
    """Suite and number, for example ``libero_spatial/0``."""
    instruction: Text
    """The instruction that LIBERO's benchmark gives."""
    versions: dict[str, str]
    """Packages of the simulator that it was recorded with."""
    budget: Positive
    """Policy steps of an episode."""
    control_hz: Positive
    """Control steps in a second of simulated time."""
    settle_steps: Count
    """No-op steps before the first policy step."""
    init: Count
    """Index of the initial state of everything that follows :attr:`starts`."""
    starts: list[RobotState]
    """The robot in initial states 0, 1, 2, ..., after the settle steps."""
    settling: list[RobotState]
    """The robot after 0, 1, 2, ... no-op steps."""
    moves: list[Move]
    """One for each of the first six components of an action, of +1."""
    openings: list[float]
    """Sums of the two finger joints' absolute positions after ten steps of -1, then +1, then -1, m."""
    pictures: dict[str, str]
    """Images of the settled state by camera, :data:`SIDE` square, RGB as delivered, base64."""
    actions: list[list[float]]
    """(N, 7): an episode in which the task is solved, from the settled state."""
    steps: list[RobotState]
    """The robot after each of them."""
    success_step: Positive
    """Number of them after which the goal holds for the first time."""

    def picture(self, camera: str) -> NDArray[np.float64]:
        """(SIDE, SIDE, 3): the small image of a camera, 0 to 255."""
        flat = np.frombuffer(base64.b64decode(self.pictures[camera]), np.uint8)
        return flat.reshape(SIDE, SIDE, 3).astype(np.float64)


def shrink(image: NDArray[np.uint8]) -> Array:
    """(SIDE, SIDE, 3) of an (H, W, 3) image: the mean of the pixels below each small one.

    Args:
        image: At least SIDE pixels high and wide.
    """
    rows, columns = (_bounds(length) for length in image.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(image.astype(np.float64), rows, axis=0), columns, axis=1)
    heights, widths = np.diff([*rows, image.shape[0]]), np.diff([*columns, image.shape[1]])
    small: Array = sums / (heights[:, None, None] * widths[None, :, None])
    return small


def _bounds(length: int) -> list[int]:
    return [length * number // SIDE for number in range(SIDE)]


def encoded(image: NDArray[np.uint8]) -> str:
    """Return an image as :attr:`TaskReference.pictures` holds it."""
    return base64.b64encode(np.rint(shrink(image)).astype(np.uint8).tobytes()).decode()


def references() -> Mapping[str, Path]:
    """Return the references that come with the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.json"))}


def read_reference(name: str | Path) -> TaskReference:
    """Read a reference of this package by its name, or any other by its path.

    Raises:
        OptionError: There is none, or it is damaged.
    """
    shipped = references()
    path = shipped.get(str(name), Path(name))
    if not path.is_file():
        raise OptionError.seen(
            "reference",
            str(name),
            f", but there is no such file and no reference of this name. {did_you_mean(str(name), shipped)}",
        )
    try:
        return decode(read_text(path).encode(), TaskReference)
    except ReportError as error:
        raise OptionError(f"reference={str(path)!r} is no task reference: {error}", path=path) from None
