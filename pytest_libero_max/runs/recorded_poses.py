"""Files with the recorded poses of a pair in three dimensions, from which the page of a run shows it.

A file holds a description in JSON, the shapes and textures that it names by their digests, and the poses of
all that moves. Pairs of one scene, and scenes of one robot, share shapes, which a page then holds once.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.array_files import read_arrays
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import decode_json, require_plain, shown
from pytest_libero_max.errors import ReportError

POSITION_M = 1e-4
"""Unit of a position in a file, m: a tenth of a millimetre, up to 3.2 m from the origin."""

TURN = 1 / 32767
"""Unit of a component of a quaternion in a file."""

_HEADER, _MOVES, _PART = "header", "moves", "part_"
_DIGITS = 16
_LEVELS = 16


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """A pair in three dimensions.

    Attributes:
        header: What is there and what it looks like, as the viewer reads it
            (:func:`~pytest_libero_max.films.scene_poses.poses_of`).
        parts: Shapes and textures as the viewer reads them, by :func:`part_name`.
        moves: Result of :func:`packed` for each arm, one after another.
    """

    header: Json
    parts: Mapping[str, bytes]
    moves: bytes


def part_name(content: bytes) -> str:
    """Return the name of a shape or texture: the beginning of its SHA-256."""
    return hashlib.sha256(content).hexdigest()[:_DIGITS]


def quantised(poses: NDArray[np.float64]) -> NDArray[np.int16]:
    """Return poses in the units of a file.

    Args:
        poses: (steps, bodies, 7): positions in m and quaternions (w, x, y, z), world frame.
    """
    units = np.array([POSITION_M] * 3 + [TURN] * 4)
    whole: NDArray[np.int16] = np.clip(np.rint(poses / units), -32767, 32767).astype(np.int16)
    return whole


def packed(values: NDArray[np.int16]) -> bytes:
    """Return poses as bytes that compress well: differences from step to step, low bytes before high bytes.

    Args:
        values: (steps, bodies, 7); along the steps they go on where those before them ended.
    """
    columns = values.reshape(len(values), -1).T
    differences = np.diff(columns, axis=1, prepend=np.zeros((len(columns), 1), np.int16))
    halves = np.ascontiguousarray(differences).view(np.uint8).reshape(-1, 2)
    return halves.T.tobytes()


def unpacked(content: bytes, steps: int, bodies: int) -> NDArray[np.int16]:
    """Return the poses that :func:`packed` packed, (steps, bodies, 7)."""
    halves = np.frombuffer(content, np.uint8).reshape(2, -1)
    differences = np.ascontiguousarray(halves.T).view(np.int16).reshape(7 * bodies, steps)
    return np.cumsum(differences, axis=1, dtype=np.int16).T.reshape(steps, bodies, 7)


def write_poses(path: Path, poses: RecordedPoses, overwrite: bool = False) -> None:
    """Write the poses of a pair; the folder is made if missing.

    Raises:
        ReportError: The file exists, or cannot be written.
    """
    if path.exists() and not overwrite:
        raise ReportError(f"{path} exists. Remove it, or allow that it is overwritten.")
    text = json.dumps(poses.header, separators=(",", ":"), allow_nan=False)
    contents = {_HEADER: text.encode(), _MOVES: poses.moves}
    contents |= {f"{_PART}{name}": content for name, content in sorted(poses.parts.items())}
    arrays = {name: np.frombuffer(content, np.uint8) for name, content in contents.items()}
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(partial, path)
    except OSError as error:
        raise ReportError(f"Cannot write {path}: {error}.") from error
    finally:
        with suppress(OSError):  # there is nothing to remove after a file that was completed
            partial.unlink()


def read_poses(path: Path) -> RecordedPoses:
    """Read what :func:`write_poses` wrote.

    Raises:
        ReportError: It cannot be read.
    """
    try:
        contents = {name: values.tobytes() for name, values in read_arrays(path).items()}
        parts = {name.removeprefix(_PART): content for name, content in contents.items() if _PART in name}
        header = decode_json(contents[_HEADER], "The header is damaged.")
        if not isinstance(header, dict):
            raise ReportError(f"the header is {shown(header)}, but must be an object")
        require_plain(header, "header", _LEVELS)
        return RecordedPoses(header, parts, contents[_MOVES])
    except (OSError, ValueError, KeyError, ReportError) as error:
        raise ReportError(
            f"Cannot read the poses in {path}: {error}. Write them again with libero-max poses."
        ) from error
