"""Published runs side by side: what each measured, what it was measured with, and what of it was checked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pytest_libero_max.benchmark.documents import canonical_digest
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.report.publication import About, PlayedAgain, about_of, checked, pairs_digest
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_texts import cases_title
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, StoredRun, read_pairs
from pytest_libero_max.worlds.rendering.context import DEVICE, drawn_by

DIGITS = 12
"""Hexadecimal digits of a digest that are shown."""


@dataclass(frozen=True, eq=False)
class IndexedRun:
    """A published run that agrees with itself."""

    folder: Path
    report: Report
    """Computed from its pairs."""
    digest: str
    """See :func:`~pytest_libero_max.report.publication.pairs_digest`."""
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
        known: Checks that played pairs, by :func:`~pytest_libero_max.report.publication.pairs_digest`.
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
