"""The case sets that the authors of LIBERO-MAX have released, by the SHA-256 of their files.

Numbers published for a released manifest hold only for the same file, byte for byte.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ReleasedFile:
    """A manifest that the authors have released."""

    file: str
    benchmark_id: str
    version: str
    """Its ``benchmark_version``; their Lite of 400 cases had the name and version of that of 800."""
    cases: int
    sha256: str
    """SHA-256 of its content, hexadecimal."""

    def __str__(self) -> str:
        return f"the authors' {self.file} {self.version}"


RELEASED = tuple(
    ReleasedFile(**values)
    for values in json.loads(Path(__file__).with_name("releases.json").read_text(encoding="utf-8"))
)
"""Newest first. Not all can be played: see :data:`NOT_PLAYED`."""

NOT_PLAYED = ("1.0.0",)
"""Versions of the authors' whose cases have a third draw of the parameters, which no report here has."""


@dataclass(frozen=True)
class Recognition:
    """Relation of a manifest to a released one."""

    released: ReleasedFile
    """The released file that it is, or is like."""
    identical: bool
    """True if it is that file, byte for byte."""

    def __str__(self) -> str:
        if self.identical:
            return str(self.released)
        return f"like {self.released}, but NOT that file: its SHA-256 is another"


def recognise(content: bytes, path: Path, benchmark_id: str | None = None) -> Recognition | None:
    """Return the released file that a manifest is, or is like; None for another manifest.

    Args:
        path: The file; a name like that of a released one, with or without ``.gz``, makes it like that one.
        benchmark_id: Its own id; that of a released one is recognised as well.
    """
    digest = hashlib.sha256(content).hexdigest()
    for released in RELEASED:
        if released.sha256 == digest:
            return Recognition(released, identical=True)
    for released in RELEASED:
        if benchmark_id == released.benchmark_id or path.name.removesuffix(".gz") == released.file:
            return Recognition(released, identical=False)
    return None
