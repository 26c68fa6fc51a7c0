"""The frozen sets of cases that come with the package."""

from __future__ import annotations

import hashlib
from pathlib import Path

from pytest_libero_max.cases import Manifest, load_manifest
from pytest_libero_max.errors import ManifestError, OptionError, did_you_mean

FOLDER = Path(__file__).resolve().parents[1] / "tracks"
"""In a source checkout this is a link to ``cases``; an installed package has the files themselves."""

CHECKSUMS = "SHA256SUMS"


def track_names() -> tuple[str, ...]:
    """The tracks there are, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.json")))


def track_path(name: str) -> Path:
    """The manifest of a track.

    Raises:
        OptionError: There is no such track; suggests the closest.
    """
    if name not in track_names():
        raise OptionError(f"track={name!r} is not a track. {did_you_mean(name, track_names())}")
    return FOLDER / f"{name}.json"


def load_track(name: str) -> Manifest:
    """Read a track and check that it is the one that was frozen.

    Raises:
        OptionError: There is no such track.
        ManifestError: Its file differs from its checksum.
    """
    path = track_path(name)
    expected = _checksums().get(path.name, "nothing of it")
    if hashlib.sha256(path.read_bytes()).hexdigest() != expected:
        raise ManifestError(
            f"{path}: the content is not the one that was frozen ({CHECKSUMS} says {expected}). "
            "Restore the file, or give an edited copy by its path as a manifest of your own."
        )
    return load_manifest(path)


def checksums_of(folder: Path) -> str:
    """The content of ``SHA256SUMS`` for the manifests of a folder."""
    lines = (
        f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}\n" for p in sorted(folder.glob("*.json"))
    )
    return "".join(lines)


def _checksums() -> dict[str, str]:
    try:
        lines = (FOLDER / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ManifestError(f"{error}. The installation is incomplete; install the package again.") from error
    return {name: digest for digest, name in (line.split() for line in lines)}
