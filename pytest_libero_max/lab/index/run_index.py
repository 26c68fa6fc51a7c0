"""Published runs side by side: what each measured, what it was measured with, and what of it was checked."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from pytest_libero_max.benchmark.documents import canonical_digest, read_content
from pytest_libero_max.benchmark.structs import decode_json
from pytest_libero_max.errors import LiberoMaxError, OptionError, ReportError
from pytest_libero_max.report.about import About, about_of
from pytest_libero_max.report.publication import checked
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import report_of, write_text
from pytest_libero_max.report.writers.summary import cases_title
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, StoredRun, read_pairs
from pytest_libero_max.worlds.rendering.context import DEVICE, drawn_by

DIGITS = 12
"""Hexadecimal digits of a digest that are shown."""


class PlayedAgain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A check of a published run in which pairs were played again and all ended alike."""

    pairs: int
    seed: str
    """By which they were drawn."""
    date: str
    """Day of the check, UTC."""
    package: str
    mujoco: str
    actions: bool = False
    """True if the recorded actions were executed, and no policy asked."""


@dataclass(frozen=True, eq=False)
class IndexedRun:
    """A published run that agrees with itself."""

    folder: Path
    report: Report
    """Computed from its pairs."""
    digest: str
    """See :func:`pairs_digest`."""
    versions: str
    """MuJoCo and what drew its images, as its records have them."""
    cases_checked: bool
    """True if its cases were compared with a frozen track."""
    about: About
    """Its authors and its model, as they are stated beside it."""
    again: PlayedAgain | None
    """The last check that played pairs of it; None for none."""


@dataclass(frozen=True, eq=False)
class RunIndex:
    """Published runs by the cases that they played: only runs of the same cases stand in one table."""

    groups: Mapping[str, Sequence[IndexedRun]]
    """The runs by title of their cases, those with the highest Dynamic success first."""
    refused: Sequence[tuple[Path, str]]
    """Folders that are not as they must be, with the reason."""


def published_in(folders: Iterable[Path]) -> list[Path]:
    """Return the published runs in and below some folders, each once, in their order.

    Raises:
        OptionError: There is none in a folder.
    """
    found: dict[Path, None] = {}
    for folder in folders:
        runs = sorted(path.parent for path in folder.rglob(PACKED_PAIRS_NAME))
        if not runs:
            raise OptionError.seen(
                "FOLDER",
                str(folder),
                ", but no published run is in it or below it. Make one: libero-max publish pack RUN FOLDER.",
            )
        found |= dict.fromkeys(runs)
    return [*found]


def run_index(folders: Sequence[Path], known: Mapping[str, PlayedAgain]) -> RunIndex:
    """Check published runs as :func:`~pytest_libero_max.report.publication.checked` does, and order them.

    Args:
        folders: Of the runs.
        known: Checks that played pairs, by :func:`pairs_digest`.
    """
    groups: dict[tuple[str, str], list[IndexedRun]] = {}
    refused = []
    for folder in folders:
        try:
            lines = [*checked(folder)]
            stored = read_pairs(folder / PACKED_PAIRS_NAME)
            report, digest, about = report_of(stored), pairs_digest(folder), about_of(folder)
        except LiberoMaxError as error:
            refused.append((folder, str(error)))
            continue
        compared = any(line.startswith("cases: ") for line in lines)
        run = IndexedRun(folder, report, digest, _versions(stored), compared, about, known.get(digest))
        groups.setdefault(_played(report, stored), []).append(run)
    titles = Counter(title for title, _ in groups)
    ordered = {
        title if titles[title] == 1 else f"{title} ({digest[:DIGITS]})": sorted(
            runs, key=lambda run: -(run.report.overall.dynamic_success.value or 0)
        )
        for (title, digest), runs in sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    }
    return RunIndex(ordered, refused)


def pairs_digest(folder: Path) -> str:
    """Return the SHA-256 of the pairs of a published run, unpacked: a check belongs to these bytes alone."""
    try:
        return hashlib.sha256(read_content(require_inside(folder, folder / PACKED_PAIRS_NAME))).hexdigest()
    except OSError as error:
        raise ReportError(f"Cannot read {folder / PACKED_PAIRS_NAME}: {error}.") from error


def read_checks(path: Path) -> dict[str, PlayedAgain]:
    """Return the checks that :func:`note_check` wrote, by digest; none where the file does not exist.

    Raises:
        ReportError: It cannot be read.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ReportError(f"Cannot read {path}: {error}.") from error
    cure = "libero-max publish verify FOLDER --record writes such a file."
    try:
        values: Any = decode_json(content, cure)
        return msgspec.convert(values, dict[str, PlayedAgain])
    except (ReportError, msgspec.ValidationError) as error:
        raise ReportError(f"{path} holds no checks of published runs: {error}. {cure}") from error


def note_check(path: Path, folder: Path, pairs: int, seed: str, actions: bool) -> None:
    """Note in a file that pairs of a published run were played again and ended alike.

    Args:
        path: The file; the checks of other runs stay in it.
        folder: Of the run.
        pairs: Number of pairs that were played.
        seed: By which they were drawn.
        actions: See :class:`PlayedAgain`.

    Raises:
        ReportError: The file cannot be read or written.
    """
    from importlib.metadata import version

    today, package, mujoco = (
        datetime.now(UTC).date().isoformat(),
        version("pytest-libero-max"),
        version("mujoco"),
    )
    check = PlayedAgain(pairs, seed, today, package, mujoco, actions)
    checks = read_checks(path) | {pairs_digest(folder): check}
    text = json.dumps(msgspec.to_builtins(checks), indent=1, sort_keys=True)
    write_text(path, f"{text}\n")


def _played(report: Report, stored: StoredRun) -> tuple[str, str]:
    """Return a title of the cases and of what happened in them, and its digest."""
    study = report.provenance["protocol"].get("study")
    title = cases_title(report) + (f", study {study['name']}" if study else "")
    planned = sorted((pair.case_id, pair.case_digest) for pair in stored.run.planned)
    return title, canonical_digest([list(pair) for pair in planned])


def _versions(stored: StoredRun) -> str:
    told = sorted(
        {
            f"MuJoCo {record.fingerprints.get('mujoco', 'not recorded')}, "
            + (drawn_by(record.fingerprints) or record.fingerprints.get(DEVICE, "renderer not recorded"))
            for record in stored.records
        }
    )
    return "; ".join(told)
