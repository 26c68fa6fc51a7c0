"""Verify frozen tracks: digests, format, identity of each case, quotas and splits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import CERTIFICATES, read_certificates
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import (
    CHECKSUMS,
    PAPER_LITE,
    UNEXAMINED,
    frozen_files,
    load_track,
    own_tracks,
    read_checksums,
    track_names,
)
from pytest_libero_max.errors import ManifestError, SubstrateError
from pytest_libero_max.events.configurations import Cell, Configuration, cell_of
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.makers.construction.case_selection import LEVELS, PLUS_PER_CELL, PRO_PER_CELL, cells_of
from pytest_libero_max.makers.construction.configurations import hosts
from pytest_libero_max.makers.construction.fresh_draw import (
    COMMITMENT,
    frozen_beside,
    read_draw,
    select_fresh,
)
from pytest_libero_max.makers.construction.matching import levelled
from pytest_libero_max.makers.construction.original import build_original
from pytest_libero_max.makers.construction.release import (
    REJECTED,
    SIGHTS,
    read_rejected,
    read_sights,
    read_unexamined,
)
from pytest_libero_max.makers.construction.splits import SPLITS, own_case_id
from pytest_libero_max.makers.construction.unmodified_tracks import require_drawn
from pytest_libero_max.report.formats import counted
from pytest_libero_max.substrates.registry import own_variation
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES, PRO_CATEGORIES


def verify(folder: Path) -> list[str]:
    """Check every track of a folder; return the checks that passed, a line each.

    Raises:
        ManifestError: The first thing that is not as it must be.
    """
    if (folder / COMMITMENT).exists():
        return list(_draw_checks(folder))
    if "original" in track_names(folder):
        return list(_checks(folder))
    _require_listed(folder)
    tracks = {name: load_track(name, folder) for name in track_names(folder)}
    unmodified = all(case.unmodified for track in tracks.values() for case in track)
    return list(_unmodified_checks(folder, tracks) if unmodified else _genuine_checks(folder))


def _unmodified_checks(folder: Path, tracks: Mapping[str, Manifest]) -> Iterator[str]:
    for name, track in tracks.items():
        yield from require_drawn(name, track)
    yield from _table_checks(folder, (case for track in tracks.values() for case in track))


def _draw_checks(folder: Path) -> Iterator[str]:
    """Yield checks of a fresh draw: its seed is the published one, and leads to these cases again."""
    _require_listed(folder)
    draw, rejected = read_draw(folder), read_rejected(folder)
    yield f"{draw.name}: the seed is the one whose digest is in {COMMITMENT}"
    cases: list[Case] = []
    for name in track_names(folder):
        manifest, frozen = load_track(name, folder), frozen_beside(folder, name, draw.name)
        redrawn = select_fresh(
            lambda proposed: [case.case_id for case in proposed if case.case_id in rejected], frozen, draw
        )
        _require_same(f"{draw.name}/{name}", manifest, redrawn)
        size = counted(len(manifest), "case")
        yield f"{name}: {size}, chosen again from the seed, digest {manifest.digest}"
        cases += manifest
    yield from _table_checks(folder, cases)


def _require_listed(folder: Path) -> None:
    files = {path.name.removesuffix(".gz") for path in frozen_files(folder)}
    listed = read_checksums(folder)
    for name in sorted(files - listed.keys()):
        raise ManifestError(f"{folder / name} is not in {CHECKSUMS}. Remove it, or restore the folder.")
    for name in sorted(listed.keys() - files):
        raise ManifestError(f"{folder / name} is in {CHECKSUMS}, but is missing. Restore the folder.")


def _checks(folder: Path) -> Iterator[str]:
    """Yield checks of the embedded tracks; those that take long come last."""
    _require_listed(folder)
    tracks = {name: load_track(name, folder) for name in ("max", "original", *SPLITS)}
    whole, original = tracks["max"], tracks["original"]
    yield _quotas(whole)
    yield _difficulties(whole)
    yield from _table_checks(folder, (*whole, *original, *tracks["beyond"]))
    for name, split in SPLITS.items():
        _require_same(name, tracks[name], split(whole))
        yield f"{name}: {counted(len(tracks[name]), 'case')}, drawn from max, digest {tracks[name].digest}"
    _require_same("original", original, build_original(read_rejected(folder)))
    yield f"original: {counted(len(original), 'case')}, digest {original.digest}"
    for case in whole:
        require_identity(case)
    yield f"max: {counted(len(whole), 'case')}, each as its identity demands, digest {whole.digest}"


def _table_checks(folder: Path, cases: Iterable[Case]) -> Iterator[str]:
    """Yield checks of the tables; cases with a program were examined without it, under another id."""
    playable = {case.case_id: case.program is None for case in cases}
    used = {name for name, plain in playable.items() if plain}
    rejected, certificates = read_rejected(folder), read_certificates(folder)
    unexamined = read_unexamined(folder)
    for name in sorted(used & rejected.keys()):
        raise ManifestError(f"case {name!r} is in a track, and in {REJECTED}.")
    for name in sorted(unexamined.keys() - used):
        raise ManifestError(f"case {name!r} is in {UNEXAMINED}, but in no track.")
    for name in sorted((used - unexamined.keys()) ^ read_sights(folder).keys()):
        raise ManifestError(f"case {name!r} is in a track or in {SIGHTS}, but not in both.")
    for name in sorted(certificates.keys() - playable.keys()):
        raise ManifestError(f"case {name!r} is in {CERTIFICATES}, but in no track.")
    yield f"{counted(len(rejected), 'rejected case')} in no track"
    if unexamined:
        yield f"{len(unexamined)} of {counted(len(used), 'case')} not examined"
    yield f"{len(certificates)} of {counted(len(playable), 'case')} with a certificate"


def _genuine_checks(folder: Path) -> Iterator[str]:
    """Yield checks that need none of the installations that the tracks were chosen from."""
    tracks = {name: load_track(name, folder) for name in track_names(folder)}
    for name, track in tracks.items():
        for case in track:
            _require_own_names(case)
        cases = counted(len(track), "case")
        yield f"{name}: {cases}, each with its identity's names and seeds, digest {track.digest}"
    if "smoke" in tracks:
        cells = Counter((case.source, case.event.name, case.event.variant) for case in tracks["smoke"])
        if cells != dict.fromkeys(product(("plus", "pro"), BENCHMARK_EVENTS, (0, 1)), 1):
            raise ManifestError("smoke: not every event, variant and source has one case.")
        yield "smoke: one case of each event, variant and source"
    if "max" in tracks:
        yield _quotas(tracks["max"])
    for name in sorted(tracks.keys() & (SPLITS.keys() - {"smoke"})):
        _require_same(name, tracks[name], SPLITS[name](tracks["max"]))
        yield f"{name}: drawn from max"
    if PAPER_LITE in tracks:
        yield f"{PAPER_LITE}: {_recognised(tracks[PAPER_LITE])}"
    yield from _table_checks(folder, (case for name in own_tracks(folder) for case in tracks[name]))


def _recognised(track: Manifest) -> str:
    if track.recognition is None or not track.recognition.identical:
        raise ManifestError(f"{PAPER_LITE} is not a file that the authors released. Restore it.")
    return str(track.recognition)


def _require_own_names(case: Case) -> None:
    category = case.source_category if case.source == "pro" else ""
    identity = Identity(case.source, case.suite, case.task_index, case.init_state_index, category)
    event = case.event
    names = case.case_id, case.record["scenario"]["scenario_id"], event.seed
    name, variant = event.name, event.variant
    expected = (
        own_case_id(identity.case_id(name, variant), case.program),
        identity.scenario_id(name, variant),
        identity.seed(name, variant),
    )
    if names != expected:
        raise ManifestError(f"case {case.case_id!r} has {names}, but its identity demands {expected}.")


def require_identity(case: Case) -> None:
    """Refuse a case that is not the one that its identity demands."""
    try:
        configuration = Configuration(own_variation(case), case.init_state_index)
    except SubstrateError as error:
        raise ManifestError(str(error)) from error
    category = configuration.variation.category
    expected = configuration.case(Cell(category, case.event.name, case.event.variant))
    if case.record != expected.record:
        keys = [key for key, value in expected.record.items() if case.record.get(key) != value]
        raise ManifestError(
            f"case {case.case_id!r}: {', '.join(keys) or 'a field that is not known'} differs from what the "
            "case's identity demands."
        )


def _quotas(whole: Manifest) -> str:
    count: Counter[tuple[Cell, str]] = Counter((cell_of(case), case.source) for case in whole)
    for categories, source, quota in (
        (PLUS_CATEGORIES, "plus", PLUS_PER_CELL),
        (PRO_CATEGORIES, "pro", PRO_PER_CELL),
    ):
        for cell in (cell for category in categories for cell in cells_of(category)):
            present = count.pop((cell, source), 0)
            if present != quota:
                raise ManifestError(
                    f"max: the cell ({cell}) has {counted(present, 'case')}, but must have {quota}."
                )
    for cell, source in count:
        raise ManifestError(f"max: there is no cell ({cell}) of source {source}.")
    _require_unique(
        ((case.source_category, case.suite, case.task_index), case) for case in whole if case.source == "plus"
    )
    _require_unique(
        ((cell_of(case), case.suite, case.task_index, case.init_state_index), case)
        for case in whole
        if case.source == "pro"
    )
    return (
        f"max: {len(PLUS_CATEGORIES)} x 16 cells of {PLUS_PER_CELL} different tasks and "
        f"{len(PRO_CATEGORIES)} x 16 cells of {PRO_PER_CELL} different configurations"
    )


def _require_unique(keyed: Iterable[tuple[object, Case]]) -> None:
    seen: dict[object, Case] = {}
    for key, case in keyed:
        if key in seen:
            raise ManifestError(
                f"max: {case.case_id!r} and {seen[key].case_id!r} use the same configuration, which no two "
                "cases of a cell (for LIBERO-Plus, of a category) may."
            )
        seen[key] = case


def _difficulties(whole: Manifest) -> str:
    """As even as supply allows in every category: no selection can be more even."""
    total = np.zeros(LEVELS, dtype=np.int64)
    for category in PLUS_CATEGORIES:
        supply = _by_difficulty(variation.difficulty for variation, _ in hosts("plus", category))
        best = levelled(supply, 16 * PLUS_PER_CELL)
        by_difficulty = _by_difficulty(case.difficulty for case in whole if case.source_category == category)
        if (np.sort(by_difficulty) != np.sort(best)).any():
            raise ManifestError(
                f"max: {category} has {by_difficulty} cases by difficulty, but {best} is more even."
            )
        total += by_difficulty
    numbers = ", ".join(map(str, total))
    return f"max: {numbers} LIBERO-Plus cases of difficulty 1 to {LEVELS}, as even as the supply allows"


def _by_difficulty(difficulties: Iterable[int | None]) -> NDArray[np.int64]:
    count = Counter(difficulties)
    return np.array([count[level] for level in range(1, LEVELS + 1)])


def _require_same(name: str, manifest: Manifest, expected: Manifest) -> None:
    if manifest == expected:
        return
    for one, other in zip(manifest, expected, strict=False):
        if one != other:
            raise ManifestError(f"{name}: {one.case_id!r} stands where {other.case_id!r} must.")
    raise ManifestError(
        f"{name}: {counted(len(manifest), 'case')} or its protocol differ from what must be "
        f"({len(expected)})."
    )
