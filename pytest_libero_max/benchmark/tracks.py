"""The frozen sets of cases that come with the package."""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Iterable
from pathlib import Path

from pytest_libero_max.benchmark.documents import read_content, read_text
from pytest_libero_max.benchmark.manifests import Manifest, decode_manifest, load_manifest
from pytest_libero_max.errors import ManifestError, OptionError, did_you_mean

_INSTALLED = Path(__file__).resolve().parents[1] / "tracks"
_CHECKOUT = Path(__file__).resolve().parents[2] / "cases"

FOLDER = _INSTALLED if _INSTALLED.is_dir() else _CHECKOUT
"""Folder of the tracks: the build copies ``cases`` into the package; a checkout has ``cases`` alone."""

GENUINE = "genuine"
"""The folder of the tracks on the genuine scenes; ``genuine/smoke`` is the name of one."""

PAPER_LITE = "paper-lite"
"""The authors' own Lite, among the genuine tracks: this package has neither chosen nor examined its cases."""

UNEXAMINED = "unexamined.tsv.gz"
"""The cases of tracks that nobody could examine, because their models are in no package."""

CHECKSUMS = "SHA256SUMS"
"""Digests of the files' contents, without compression: a name in it has no ``.gz``."""


def track_names(folder: Path = FOLDER) -> tuple[str, ...]:
    """Return the names of the tracks, sorted."""
    return tuple(sorted(path.name.partition(".json")[0] for path in folder.glob("*.json*")))


def own_tracks(folder: Path) -> tuple[str, ...]:
    """Return the tracks whose cases this package chose, examined and certified."""
    return tuple(name for name in track_names(folder) if name != PAPER_LITE)


def name_in(below: str, name: str, folder: Path = FOLDER) -> str:
    """Return the name of a track's version in a folder below if there is one, else the name unchanged."""
    return f"{below}/{name}" if below and name in track_names(folder / below) else name


def track_path(name: str, folder: Path = FOLDER) -> Path:
    """Return the manifest of a track, or raise OptionError or ManifestError."""
    require_tracks(folder)
    known = all_track_names(folder)
    if name not in known:
        raise OptionError.seen("track", name, f" is not a track. {did_you_mean(name, known)}")
    plain = folder / f"{name}.json"
    return plain if plain.exists() else folder / f"{name}.json.gz"


def require_tracks(folder: Path) -> None:
    """Check that a folder has tracks, or raise ManifestError."""
    if not track_names(folder):
        cure = "The installation is incomplete: install the package again."
        if folder not in (FOLDER, FOLDER / GENUINE):
            cure = "Give a folder that libero-max dev build has written."
        raise ManifestError(f"{folder} has no tracks. {cure}")


def all_track_names(folder: Path = FOLDER) -> tuple[str, ...]:
    """Return the names of the tracks as ``--libero-max-track`` takes them.

    Those in a folder below come last: the genuine ones and those of fresh draws, such as ``2026Q4/lite``.
    """
    below = sorted(path for path in folder.iterdir() if path.is_dir())
    return (*track_names(folder), *(f"{path.name}/{track}" for path in below for track in track_names(path)))


def load_track(name: str, folder: Path = FOLDER) -> Manifest:
    """Read a track and check that it is the one that was frozen.

    Raises:
        OptionError: There is no such track.
        ManifestError: Its file differs from its checksum, or there are no tracks at all.
    """
    path = track_path(name, folder)
    return decode_manifest(frozen_content(path), path)


def unexamined_cases(name: str, folder: Path = FOLDER) -> frozenset[str]:
    """Return the ids of the cases that were not examined, of all tracks in the folder of a track.

    Raises:
        ManifestError: The table differs from its checksum.
    """
    path = (folder / name).parent / UNEXAMINED
    if not path.exists():
        return frozenset()
    lines = frozen_content(path).decode().splitlines()[1:]
    return frozenset(line.partition("\t")[0] for line in lines)


def is_manifest_path(name: str) -> bool:
    """Return True if cases are named by the path of a manifest; otherwise it is a track."""
    return Path(name).suffix in (".json", ".gz")


def load_cases(name: str) -> Manifest:
    """Read a track by its name, or a manifest by its path, or raise OptionError or ManifestError."""
    return load_manifest(Path(name)) if is_manifest_path(name) else load_track(name)


def frozen_content(path: Path) -> bytes:
    """Return the content of a file, compared with its checksum, or raise ManifestError."""
    content = content_of(path)
    expected = read_checksums(path.parent).get(path.name.removesuffix(".gz"), "nothing of it")
    if hashlib.sha256(content).hexdigest() != expected:
        raise ManifestError(
            f"{path}: the content is not the one that was frozen ({CHECKSUMS} says {expected}). "
            "Restore the file, or give an edited copy by its path as a manifest of your own."
        )
    return content


def read_table(path: Path) -> list[list[str]]:
    """Return the rows of a frozen table, without its head, or raise ManifestError."""
    return [line.split("\t") for line in frozen_content(path).decode().splitlines()[1:]]


def content_of(path: Path) -> bytes:
    """Return the bytes of a file, unpacked where it is compressed, or raise ManifestError."""
    try:
        return read_content(path)
    except OSError as error:
        raise ManifestError(f"{error}. The file is missing or damaged; restore it.") from error


def write_frozen(path: Path, content: str) -> None:
    """Write a file, compressed where its name says so, the same bytes every time."""
    raw = content.encode()
    path.write_bytes(gzip.compress(raw, mtime=0) if path.suffix == ".gz" else raw)


def write_checksums(folder: Path, files: Iterable[str]) -> None:
    """Write ``SHA256SUMS`` for some files of a folder."""
    digests = {
        name.removesuffix(".gz"): hashlib.sha256(content_of(folder / name)).hexdigest() for name in files
    }
    lines = (f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def frozen_files(folder: Path) -> tuple[Path, ...]:
    """Return the files that must have a checksum: manifests and tables, compressed or not, sorted."""
    kinds = ("*.json", "*.json.gz", "*.tsv", "*.tsv.gz")
    return tuple(sorted(path for kind in kinds for path in folder.glob(kind)))


def read_checksums(folder: Path) -> dict[str, str]:
    """Digests of contents by name without ``.gz``.

    Raises:
        ManifestError: The list is missing or damaged.
    """
    try:
        lines = read_text(folder / CHECKSUMS).splitlines()
        return {name: digest for digest, name in (line.split() for line in lines)}
    except OSError as error:
        raise ManifestError(f"{error}. The installation is incomplete; install the package again.") from error
    except ValueError as error:
        raise ManifestError(
            f"{folder / CHECKSUMS} is damaged ({error}): each line is a digest and a name. Restore it."
        ) from error
