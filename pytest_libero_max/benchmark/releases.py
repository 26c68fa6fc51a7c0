"""The case sets that the authors of LIBERO-MAX have released, by the SHA-256 of their files.

Numbers published for a released manifest hold only for the same file, byte for byte.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ReleasedFile:
    """A manifest that the authors have released.

    Attributes:
        file: Its name.
        benchmark_id: Its own id.
        version: Its ``benchmark_version``.
        cases: Number of its cases.
        sha256: Of its content, hexadecimal.
    """

    file: str
    benchmark_id: str
    version: str
    cases: int
    sha256: str

    def __str__(self) -> str:
        return f"the authors' {self.file} {self.version}"


RELEASED = (
    ReleasedFile(
        "libero_max_8000.json",
        "libero-max-8000",
        "3.0.0",
        8000,
        "d26c38517b08709645a44b7fcf572f47eca056f7d01f1a7f5555dacf159dd1ed",
    ),
    ReleasedFile(
        "libero_max_pro_hard_2400.json",
        "libero-max-pro-hard-2400",
        "3.0.0",
        2400,
        "c1bae5ca9082ef1936c245596f351f6d26d2fd242427686e965882fe3e7b8781",
    ),
    ReleasedFile(
        "libero_max_pro_model_comparison_800.json",
        "libero-max-pro-model-comparison-800",
        "3.0.0",
        800,
        "82e9ce023a1f329d48e93aa398ee42e2e1c33ef468cfd9f5034a4246fae03534",
    ),
    ReleasedFile(
        "intent_96.json",
        "libero-max-intent-96",
        "3.0.0",
        96,
        "21a13c0588e1489732315aaff10925a0165898998cf3c330673b943fb1096ffb",
    ),
    ReleasedFile(
        "libero_max_5600.json",
        "libero-max-5600",
        "2.0.0",
        5600,
        "290ae46e9b31441f02d0d971556ef34ff76efffa038f7bb073f7db13b48c6d4c",
    ),
    ReleasedFile(
        "intent_96.json",
        "libero-max-intent-96",
        "2.0.0",
        96,
        "19f55f3f8975d3433df034c6c4178e69000b2dd041cc5cf1240273231e53c57b",
    ),
    ReleasedFile(
        "core.json",
        "libero-max-v1-core",
        "1.0.0",
        1335,
        "ac49a3136c5e02a2f731f0b412cc6cb1b9a526ceb635c1c76e60fd563f0eef38",
    ),
)
"""Newest first. :mod:`.manifests` names those that cannot be played."""


@dataclass(frozen=True)
class Recognition:
    """Relation of a manifest to a released one.

    Attributes:
        released: The released file that it is, or is like.
        identical: True if it is that file, byte for byte.
    """

    released: ReleasedFile
    identical: bool

    def __str__(self) -> str:
        if self.identical:
            return str(self.released)
        return f"like {self.released}, but NOT that file: its SHA-256 is another"


def recognise(content: bytes, path: Path, benchmark_id: str | None = None) -> Recognition | None:
    """Return the released file that a manifest is, or is like; None for another manifest.

    Args:
        content: The manifest's bytes, unpacked.
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
