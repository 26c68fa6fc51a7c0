"""Fresh draws: new cases from the population of a frozen track, by a seed to which somebody was bound before.

A frozen track is learnt from in time. A draw gives each of its cases a partner, in the same cell (source
category, event, variant) and in a scene, a variation with an initial state, that no frozen track has. Success
on the old cases minus success on the new ones shows what was learnt from the cases themselves.

The seed is kept secret until the draw is made, and its digest is published before: whoever makes the draw
cannot choose a seed afterwards, and whoever trains a policy before cannot know the cases. Everything else is
a function of the seed, of the frozen tracks and of the preflight: others can choose the same cases again.
"""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.identity import Draw, seed_of
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import load_track, track_names
from pytest_libero_max.errors import ManifestError, OptionError
from pytest_libero_max.events.configurations import PRO_STATES, Cell, Configuration, cell_of
from pytest_libero_max.makers.construction.case_selection import Examine
from pytest_libero_max.makers.construction.configurations import hosts
from pytest_libero_max.makers.construction.release import ExamineCases, Examined, Release, read_rejected
from pytest_libero_max.runs.plan import task_number

SEED, COMMITMENT = "SEED", "SEED.sha256"
"""Files of a draw: its revealed seed, and the digest published before, as ``sha256sum`` writes it."""

_NAME = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]*")
_SEED_BYTES = 32

Scene = tuple[str, str, str, int, int]
"""Source, source category, suite, index of the task and of the initial state."""


class Frozen(NamedTuple):
    """The tracks that a draw is fresh against."""

    old: Manifest
    """The track whose cases get partners."""
    scenes: Collection[Scene]
    """Scenes of all cases of all tracks, and of earlier draws."""
    rejected: Collection[str]
    """Ids of cases that failed the preflight when the tracks were built."""


def bind(folder: Path, name: str, seed_file: Path) -> str:
    """Draw a seed, keep it in a file, and write its digest into the folder of a draw, for example ``2026Q4``.

    Returns:
        The digest to publish. The seed stays secret until the draw is made.

    Raises:
        OptionError: The name is none, or one of the files exists.
    """
    if not _NAME.fullmatch(name):
        raise OptionError.seen(
            "draw", name, ", but a name has letters, digits, dots, dashes and underscores only, like 2026Q4."
        )
    for path in (seed_file, folder / COMMITMENT):
        if path.exists():
            raise OptionError(
                f"{path} exists: the draw {name} has a seed already. Make the draw without --commit, or give "
                "it another name."
            )
    text = f"{name} {secrets.token_hex(_SEED_BYTES)}\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    for path, content in ((seed_file, text), (folder / COMMITMENT, f"{digest}  {SEED}\n")):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return digest


def read_draw(folder: Path, seed_file: Path | None = None) -> Draw:
    """Read the seed of a draw, and check that it is the one whose digest was published.

    Args:
        seed_file: File of the seed; None for the one that the folder reveals.

    Raises:
        ManifestError: A file is missing or damaged, or the seed is another one.
    """
    path = folder / SEED if seed_file is None else seed_file
    try:
        text, published = read_text(path), read_text(folder / COMMITMENT)
    except OSError as error:
        raise ManifestError(
            f"{error}. A draw needs its seed, and the digest of it that was published before. Make both with "
            "libero-max dev build FOLDER --draw NAME --commit."
        ) from error
    digest = hashlib.sha256(text.encode()).hexdigest()
    if digest != published.partition(" ")[0]:
        raise ManifestError(
            f"{path} has the digest {digest}, but {folder / COMMITMENT} has another one: it is not the seed "
            "that was published. Give the file that was made with the digest."
        )
    name, _, seed = text.strip().partition(" ")
    return Draw(name, seed)


def frozen_beside(folder: Path, track: str, draw: str) -> Frozen:
    """Read the tracks of the folder above that of a draw, and the draws whose names come before its own.

    Raises:
        OptionError: There is no such track, or a draw with a later name has been made.
        ManifestError: A file is missing or is not the one that was frozen.
    """
    above = folder.resolve().parent
    scenes = {scene_of(case) for name in track_names(above) for case in load_track(name, above)}
    for other in sorted(path.parent for path in above.glob(f"*/{SEED}")):
        if other.name > draw:
            raise OptionError(
                f"{other} is a draw with a later name, and draws keep away from those before them. Give the "
                "new draw a name that comes after it."
            )
        if other.name != draw:
            scenes |= {scene_of(case) for name in track_names(other) for case in load_track(name, other)}
    return Frozen(load_track(track, above), scenes, read_rejected(above).keys())


def scene_of(case: Case) -> Scene:
    """Return the scene of a case."""
    return case.source, case.source_category, case.suite, case.task_index, case.init_state_index


def build_draw(examine: ExamineCases, track: str, frozen: Frozen, draw: Draw) -> Release:
    """Choose the cases of a draw."""
    examined = Examined(examine)
    return examined.release({track: select_fresh(examined.failing, frozen, draw)})


def select_fresh(examine: Examine, frozen: Frozen, draw: Draw) -> Manifest:
    """Give each case of a track a partner, and replace those that fail until none does.

    The partner is the first configuration of the cell that is left, in this order: those of the same task of
    LIBERO, of the same suite, of the nearest difficulty, then by a hash of the seed. No scene is used twice.
    An event that was rejected on the same scene when the frozen tracks were built is not examined again. Each
    case stands at the place of its partner in the old track.

    Raises:
        ManifestError: A case can have no partner.
    """
    old = frozen.old
    pools: dict[Cell, list[_Candidate]] = {}
    for case in old:
        if cell_of(case) not in pools:
            pools[cell_of(case)] = _candidates(case.source, cell_of(case), frozen, draw)
    waiting = {number: _preferred(pools[cell_of(case)], case) for number, case in enumerate(old)}
    chosen: dict[int, Case] = {}
    used: set[Scene] = set()
    failed: set[tuple[Cell, Scene]] = set()
    while len(chosen) < len(old):
        new: dict[int, tuple[Case, Scene]] = {}
        for number in sorted(waiting.keys() - chosen.keys()):
            cell = cell_of(old.cases[number])
            free = (
                candidate
                for candidate in waiting[number]
                if candidate.scene not in used and (cell, candidate.scene) not in failed
            )
            candidate = next(
                (candidate for candidate in free if not _known_to_fail(candidate, cell, frozen.rejected)),
                None,
            )
            if candidate is None:
                raise ManifestError(
                    f"case {old.cases[number].case_id!r} can have no partner: in its cell ({cell}) every "
                    "scene is in a frozen track, in use or failed the preflight. Draw partners for a smaller "
                    "track."
                )
            used.add(candidate.scene)
            new[number] = candidate.configuration.case(cell), candidate.scene
        failed_now = set(examine([case for case, _ in new.values()]))
        for number, (case, scene) in new.items():
            if case.case_id in failed_now:
                failed.add((cell_of(case), scene))
                used.remove(scene)  # another event may be possible in it
            else:
                chosen[number] = case
    contract = (
        f"fresh draw {draw.name} for {old.benchmark_id} {old.digest[:16]}: for each case another one of the "
        "same cell in a scene of no frozen track; same task, same suite, nearest difficulty, then SHA-256 "
        "rank by the revealed seed; physical preflight; independent of policy outcomes"
    )
    return Manifest(
        f"{old.benchmark_id}-{draw.name}",
        old.version,
        {**old.protocol, "selection_contract": contract},
        tuple(chosen[number] for number in range(len(old))),
    )


class _Candidate(NamedTuple):
    """A configuration that can host the event of a cell."""

    configuration: Configuration
    scene: Scene
    rank: int


def _candidates(source: str, cell: Cell, frozen: Frozen, draw: Draw) -> list[_Candidate]:
    """Return the configurations that can host the event of a cell and whose scene no track has."""
    candidates = []
    for variation, events in hosts(source, cell.category):
        if cell.event not in events:
            continue
        where = variation.suite, variation.index
        for init in range(PRO_STATES if source == "pro" else 1):
            scene = (source, cell.category, *where, init)
            if scene not in frozen.scenes:
                rank = seed_of(draw.name, *cell, *where, init, draw.seed)
                candidates.append(_Candidate(Configuration(variation, init, draw=draw), scene, rank))
    return candidates


def _preferred(candidates: Iterable[_Candidate], case: Case) -> list[_Candidate]:
    task = _task(case)

    def preference(candidate: _Candidate) -> tuple[bool, bool, int, int]:
        variation = candidate.configuration.variation
        other_task = (variation.suite, str(variation.base_index)) != task
        gap = abs((variation.difficulty or 0) - (case.difficulty or 0))
        return other_task, variation.suite != case.suite, gap, candidate.rank

    return sorted(candidates, key=preference)


def _known_to_fail(candidate: _Candidate, cell: Cell, rejected: Collection[str]) -> bool:
    """Return True if the same change of the same scene was rejected when the frozen tracks were built."""
    before = candidate.configuration._replace(draw=None)
    if before.case_id(cell) not in rejected:
        return False
    event, then = candidate.configuration.case(cell).event, before.case(cell).event
    return (event.change, event.setup) == (then.change, then.setup)


def _task(case: Case) -> tuple[str, str]:
    return case.suite, task_number(case)
