"""The case sets that the authors of LIBERO-MAX have released, by the SHA-256 of their files.

Numbers published for a released manifest hold only for the same file, byte for byte.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType


@dataclass(frozen=True)
class ReleasedFile:
    """A manifest that the authors have released."""

    file: str
    benchmark_id: str
    """Its own id."""
    version: str
    """Its ``benchmark_version``; their Lite of 400 cases had the name and version of that of 800."""
    cases: int
    sha256: str
    """SHA-256 of its content, hexadecimal."""

    def __str__(self) -> str:
        return f"the authors' {self.file} {self.version}"


_MAX = ("libero_max_8000.json", "libero-max-8000", 8000)
_HARD = ("libero_max_pro_hard_2400.json", "libero-max-pro-hard-2400", 2400)
_COMPARISON = ("libero_max_pro_model_comparison_800.json", "libero-max-pro-model-comparison-800", 800)
_INTENT = ("intent_96.json", "libero-max-intent-96", 96)
_LITE = ("libero_max_lite.json", "libero-max-lite", 800)

_FILES = MappingProxyType(
    {
        "3.0.0": (
            (*_MAX, "d26c38517b08709645a44b7fcf572f47eca056f7d01f1a7f5555dacf159dd1ed"),
            (*_HARD, "c1bae5ca9082ef1936c245596f351f6d26d2fd242427686e965882fe3e7b8781"),
            (*_COMPARISON, "82e9ce023a1f329d48e93aa398ee42e2e1c33ef468cfd9f5034a4246fae03534"),
            (*_INTENT, "21a13c0588e1489732315aaff10925a0165898998cf3c330673b943fb1096ffb"),
            (*_LITE, "0f2b7fc879e91f1ab85156f005adbb708c68966c631603f179f8153f4f2e22f7"),
            (
                "libero_max_lite_800.json",
                "libero-max-lite-800",
                800,
                "6240b0f73f93db263e5c9606870a6bc008ccbb735ed6d92d76b442e14d03dbdd",
            ),
        ),
        "3.0.0 of 400 cases": (
            (
                "libero_max_lite.json",
                "libero-max-lite",
                400,
                "a27250e163aef96f5188b8a93d73f970284720ead0002e4235854f1d6f2e1588",
            ),
        ),
        "2.0.0": (
            (
                "libero_max_5600.json",
                "libero-max-5600",
                5600,
                "290ae46e9b31441f02d0d971556ef34ff76efffa038f7bb073f7db13b48c6d4c",
            ),
            (*_INTENT, "19f55f3f8975d3433df034c6c4178e69000b2dd041cc5cf1240273231e53c57b"),
        ),
        "1.0.0": (
            (
                "full.json",
                "libero-max-v1-full",
                4005,
                "309c987e7cf6b60537dfbbc61c658d39f4acb907b41892ac242b112c31e0e1a5",
            ),
            (
                "core.json",
                "libero-max-v1-core",
                1335,
                "ac49a3136c5e02a2f731f0b412cc6cb1b9a526ceb635c1c76e60fd563f0eef38",
            ),
            (
                "ablation_core.json",
                "libero-max-v1-physical-ablation-core",
                180,
                "eea6a0112b96cf7bab16bb5e3eec0c046886a5f0f16ccde3b19466ae4d381c1f",
            ),
            (
                "intent_core.json",
                "libero-max-v1-intent-core",
                96,
                "a3a21c223f63b5785f56d75e01fffc2b655d8b9418d6b049b55b78c8552f78f7",
            ),
        ),
    }
)

RELEASED = tuple(
    ReleasedFile(file, benchmark_id, version, cases, sha256)
    for version, files in _FILES.items()
    for file, benchmark_id, cases, sha256 in files
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
