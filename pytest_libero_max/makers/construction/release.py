"""The files of the benchmark: tracks, rejected cases, visibility, certificates and checksums.

Certificates come last, into a folder whose tracks are frozen: nothing that an expert does can reach them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import CERTIFICATES, Certificate, read_certificates
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import (
    PAPER_LITE,
    UNEXAMINED,
    frozen_files,
    load_track,
    own_tracks,
    read_checksums,
    read_table,
    write_checksums,
    write_frozen,
)
from pytest_libero_max.makers.construction.case_selection import select
from pytest_libero_max.makers.construction.original import select_original
from pytest_libero_max.makers.construction.preflight import Check, Preflight, Problem
from pytest_libero_max.makers.construction.splits import SPLITS, full
from pytest_libero_max.makers.construction.visibility import Sight
from pytest_libero_max.worlds.robot import CAMERAS

REJECTED, SIGHTS = "rejected.tsv.gz", "visibility.tsv.gz"
"""Only there if some cases of the tracks could not be examined."""

FILES = (REJECTED, CERTIFICATES, SIGHTS, *(f"{name}.json.gz" for name in ("original", "max", *SPLITS)))
"""Everything of the embedded tracks that has a checksum."""


ExamineCases = Callable[[Sequence[Case]], Mapping[str, Preflight]]
"""Examines cases, and returns their preflights by id."""


@dataclass(frozen=True)
class Release:
    """Everything that is frozen."""

    tracks: Mapping[str, Manifest]
    """Manifests by name."""
    rejected: Mapping[str, tuple[Problem, ...]]
    """The problems of the cases that were replaced, by id."""
    sights: Mapping[str, tuple[Sight, ...]]
    """Visibility of target and receptacle at the event of each of these cases, by id."""
    unexamined: Mapping[str, str] = field(default_factory=dict)
    """Missing requirements of the other cases, by id."""
    cameras: tuple[str, ...] = CAMERAS
    """The cameras of the robot, in whose order sights have their numbers."""


class Examined:
    """Cases that were examined so far.

    Args:
        examine: Returns the preflights of cases by their ids.
    """

    def __init__(self, examine: ExamineCases) -> None:
        self._examine = examine
        self._preflights: dict[str, Preflight] = {}

    def failing(self, cases: Sequence[Case]) -> list[str]:
        """Examine cases, and return the ids of those that fail."""
        now = self._examine(cases)
        self._preflights.update(now)
        return [case_id for case_id, preflight in now.items() if not preflight.passed]

    def release(self, tracks: Mapping[str, Manifest], unexamined: Mapping[str, str] | None = None) -> Release:
        """Return tracks with what was found of their cases, and of those that were rejected.

        Args:
            unexamined: Missing requirements of cases that could not be examined, by id.
        """
        used = sorted({case.case_id for track in tracks.values() for case in track})
        known = self._preflights
        return Release(
            tracks,
            {name: result.problems for name, result in sorted(known.items()) if result.problems},
            {name: known[name].sights for name in used if name in known},
            {name: unexamined[name] for name in used if name in unexamined} if unexamined else {},
        )


def build_release(examine: ExamineCases) -> Release:
    """Choose the cases of every track.

    Raises:
        ManifestError: There are not enough cases that pass.
    """
    examined = Examined(examine)
    original = select_original(examined.failing)
    whole = full(select(examined.failing))
    return examined.release(
        {"original": original, "max": whole, **{name: split(whole) for name, split in SPLITS.items()}}
    )


def write_release(release: Release, folder: Path) -> None:
    """Write all files of a release, with an empty table of certificates."""
    folder.mkdir(parents=True, exist_ok=True)
    rejected = (
        (name, problem.check, problem.detail)
        for name, problems in release.rejected.items()
        for problem in problems
    )
    sights = (
        (name, one.role, one.entity, *map(str, (*one.before, *one.after)))
        for name, found in release.sights.items()
        for one in found
    )
    _write_table(folder / REJECTED, ("case_id", "check", "detail"), rejected)
    pixels = (f"{camera}_{when}" for when in ("before", "after") for camera in release.cameras)
    _write_table(folder / SIGHTS, ("case_id", "role", "entity", *pixels), sights)
    tables = [REJECTED, SIGHTS, CERTIFICATES]
    if release.unexamined:
        _write_table(folder / UNEXAMINED, ("case_id", "missing"), release.unexamined.items())
        tables.append(UNEXAMINED)
    _write_certificates(folder, {})
    _write_tracks(folder, release.tracks)
    kept = [PAPER_LITE] if (folder / _file(PAPER_LITE)).exists() else []
    write_checksums(folder, [*tables, *map(_file, (*release.tracks, *kept))])


def add_track(folder: Path, name: str, manifest: Manifest) -> None:
    """Write one more track into a folder of frozen ones."""
    listed = read_checksums(folder)
    _write_tracks(folder, {name: manifest})
    files = (file.name for file in frozen_files(folder))
    write_checksums(
        folder, [file for file in files if file == _file(name) or file.removesuffix(".gz") in listed]
    )


def add_certificates(
    folder: Path, names: Iterable[str], certify: Callable[[Sequence[Case]], Mapping[str, Certificate]]
) -> None:
    """Let an expert play the cases of tracks of a folder that were examined and have no certificate yet.

    Raises:
        ManifestError: A file is missing or is not the one that was frozen.
        OptionError: There is no such track.
    """
    certificates = read_certificates(folder)
    cases = {case.case_id: case for name in names for case in load_track(name, folder)}
    done = certificates.keys() | read_unexamined(folder).keys()
    new = certify([case for case_id, case in sorted(cases.items()) if case_id not in done])
    _write_certificates(folder, {**certificates, **new})
    listed = read_checksums(folder)
    write_checksums(
        folder, [file.name for file in frozen_files(folder) if file.name.removesuffix(".gz") in listed]
    )


def _write_certificates(folder: Path, certificates: Mapping[str, Certificate]) -> None:
    rows = (
        (name, certificate.ending, _text(certificate.trigger_step), _text(certificate.steps))
        for name, certificate in sorted(certificates.items())
    )
    _write_table(folder / CERTIFICATES, ("case_id", "ending", "trigger_step", "steps"), rows)


def write_splits(folder: Path) -> None:
    """Draw the smaller tracks of a folder again from its ``max``."""
    whole = load_track("max", folder)
    _write_tracks(folder, {name: split(whole) for name, split in SPLITS.items()})
    write_checksums(folder, FILES)


def read_rejected(folder: Path) -> dict[str, tuple[Problem, ...]]:
    """Return the problems of the cases that were replaced, by id."""
    rejected: dict[str, tuple[Problem, ...]] = {}
    for name, check, detail in read_table(folder / REJECTED):
        rejected[name] = (*rejected.get(name, ()), Problem(cast(Check, check), detail))
    return rejected


def independent_tracks(folder: Path) -> tuple[str, ...]:
    """Return the tracks that have every case of a folder, without those that were drawn from them."""
    names = own_tracks(folder)
    return ("original", "max", "beyond") if "original" in names else names


def read_sights(folder: Path) -> dict[str, tuple[Sight, ...]]:
    """Return the visibility of target and receptacle at the event of each case, by id."""
    sights: dict[str, tuple[Sight, ...]] = {}
    for name, role, entity, *pixels in read_table(folder / SIGHTS):
        numbers = tuple(map(int, pixels))
        cameras = len(numbers) // 2
        sight = Sight(role, entity, numbers[:cameras], numbers[cameras:])
        sights[name] = (*sights.get(name, ()), sight)
    return sights


def read_unexamined(folder: Path) -> dict[str, str]:
    """Return the missing requirements of the cases that were not examined, by id."""
    path = folder / UNEXAMINED
    return {row[0]: row[1] for row in read_table(path)} if path.exists() else {}


def _text(number: int | None) -> str:
    return "" if number is None else str(number)


def _write_tracks(folder: Path, tracks: Mapping[str, Manifest]) -> None:
    for name, manifest in tracks.items():
        write_frozen(folder / _file(name), manifest.to_json())


def _file(track: str) -> str:
    return f"{track}.json.gz"


def _write_table(path: Path, head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    write_frozen(path, "".join("\t".join(row) + "\n" for row in (head, *rows)))
