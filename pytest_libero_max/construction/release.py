"""The files of the benchmark: tracks, rejected cases, certificates and checksums."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import (
    frozen_content,
    load_track,
    write_checksums,
    write_frozen,
)
from pytest_libero_max.construction.examination import Certificate, Examination
from pytest_libero_max.construction.preflight import Check, Problem
from pytest_libero_max.construction.selection import select
from pytest_libero_max.construction.smoke import select_smoke
from pytest_libero_max.construction.splits import SPLITS, full
from pytest_libero_max.errors import ManifestError

REJECTED, CERTIFICATES = "rejected.tsv.gz", "certificates.tsv.gz"
FILES = (REJECTED, CERTIFICATES, *(f"{name}.json.gz" for name in ("smoke", "max", *SPLITS)))
"""Everything that has a checksum."""


@dataclass(frozen=True)
class Release:
    """Everything that is frozen.

    Attributes:
        tracks: Manifests by name.
        rejected: The problems of the cases that were replaced, by id.
        certificates: How the expert did on each case of ``smoke`` and ``max``, by id.
    """

    tracks: Mapping[str, Manifest]
    rejected: Mapping[str, tuple[Problem, ...]]
    certificates: Mapping[str, Certificate]


def build_release(examine: Callable[[Sequence[Case]], Mapping[str, Examination]]) -> Release:
    """Choose the cases of every track.

    Args:
        examine: The examinations on some cases by id. Certificates in them are kept, and decide nothing.

    Raises:
        ManifestError: There are not enough cases that pass.
    """
    examinations: dict[str, Examination] = {}

    def failing(cases: Sequence[Case]) -> list[str]:
        found = examine(cases)
        examinations.update(found)
        return [case_id for case_id, examination in found.items() if not examination.passed]

    smoke = select_smoke(failing)
    whole = full(select(failing))
    used = sorted(case.case_id for manifest in (smoke, whole) for case in manifest)
    return Release(
        tracks={"smoke": smoke, "max": whole, **{name: split(whole) for name, split in SPLITS.items()}},
        rejected={name: found.problems for name, found in sorted(examinations.items()) if found.problems},
        certificates={name: _certificate(examinations[name]) for name in used},
    )


def write_release(release: Release, folder: Path) -> None:
    """Write all files of a release."""
    folder.mkdir(parents=True, exist_ok=True)
    rejected = (
        (name, problem.check, problem.detail)
        for name, problems in release.rejected.items()
        for problem in problems
    )
    certificates = (
        (name, str(int(one.solved)), str(one.trigger_step), str(one.steps))
        for name, one in release.certificates.items()
    )
    _write_table(folder / REJECTED, ("case_id", "check", "detail"), rejected)
    _write_table(folder / CERTIFICATES, ("case_id", "solved", "trigger_step", "steps"), certificates)
    _write_tracks(folder, release.tracks)


def write_splits(folder: Path) -> None:
    """Draw the smaller tracks of a folder again from its ``max``.

    Raises:
        ManifestError: ``max`` is not the one that was frozen.
    """
    whole = load_track("max", folder)
    _write_tracks(folder, {name: split(whole) for name, split in SPLITS.items()})


def read_rejected(folder: Path) -> dict[str, tuple[Problem, ...]]:
    """The problems of the cases that were replaced, by id.

    Raises:
        ManifestError: The table is missing or is not the one that was frozen.
    """
    found: dict[str, tuple[Problem, ...]] = {}
    for name, check, detail in _read_table(folder / REJECTED):
        found[name] = (*found.get(name, ()), Problem(cast(Check, check), detail))
    return found


def read_certificates(folder: Path) -> dict[str, Certificate]:
    """How the expert did on each case of ``smoke`` and ``max``, by id.

    Raises:
        ManifestError: The table is missing or is not the one that was frozen.
    """
    return {
        name: Certificate(solved == "1", int(trigger), int(steps))
        for name, solved, trigger, steps in _read_table(folder / CERTIFICATES)
    }


def _certificate(examination: Examination) -> Certificate:
    if examination.certificate is None:
        raise ManifestError(f"case {examination.case_id!r} passed the preflight, but has no certificate.")
    return examination.certificate


def _write_tracks(folder: Path, tracks: Mapping[str, Manifest]) -> None:
    for name, manifest in tracks.items():
        write_frozen(folder / f"{name}.json.gz", manifest.to_json())
    write_checksums(folder, FILES)


def _write_table(path: Path, head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    write_frozen(path, "".join("\t".join(row) + "\n" for row in (head, *rows)))


def _read_table(path: Path) -> list[list[str]]:
    return [line.split("\t") for line in frozen_content(path).decode().splitlines()[1:]]
