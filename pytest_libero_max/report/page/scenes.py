"""The poses of pairs in three dimensions, as a page holds them: each shape and texture once."""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.media import poses_in
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.recorded_poses import RecordedPoses, read_poses

MOST_CHARACTERS = 3_000_000
"""Number of characters that all poses of a page take together; pairs beyond are left out."""


@dataclass(frozen=True)
class Scenes:
    """The poses that a page holds.

    Attributes:
        named: Name of the poses of each pair, by item id.
        contents: Poses, shapes and textures by name, as gzip in base64. The content of a pair is the length
            of its header (four bytes, the lowest first), the header, and the poses.
    """

    named: dict[str, str] = field(default_factory=dict)
    contents: dict[str, str] = field(default_factory=dict)


def scenes_of(folder: Path, items: Iterable[str], most: int = MOST_CHARACTERS) -> Scenes:
    """Return the poses of the pairs of a run that have some, as many as a page may hold.

    Files that cannot be read are left out, as films are that are not there.

    Args:
        folder: Of the run.
        items: Item ids of the pairs, those that matter most first.
        most: Largest number of characters.
    """
    found, scenes, left = poses_in(folder), Scenes(), most
    for item in dict.fromkeys(items):
        if item not in found:
            continue
        try:
            poses = read_poses(require_inside(folder, found[item]))
        except ReportError:
            continue
        name = f"pair-{len(scenes.named)}"
        contents = {part: content for part, content in poses.parts.items() if part not in scenes.contents} | {
            name: _whole(poses)
        }
        packed = {part: _packed(content) for part, content in contents.items()}
        size = sum(map(len, packed.values()))
        if size > left:
            continue
        left -= size
        scenes.named[item] = name
        scenes.contents.update(packed)
    return scenes


def _whole(poses: RecordedPoses) -> bytes:
    header = json.dumps(poses.header, separators=(",", ":"), allow_nan=False).encode()
    return struct.pack("<I", len(header)) + header + poses.moves


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, mtime=0)).decode()
