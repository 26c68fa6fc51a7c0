"""The tracks on genuine scenes: chosen from the installed LIBERO-Plus and LIBERO-PRO by the same rules.

Max and the tracks drawn from it have the quotas of the embedded tracks. A case whose models are missing stays
without being examined, and is listed with the missing ones. Smoke is chosen on its own, from the tasks that
need no models but LIBERO's and LIBERO-PRO's, so that everybody with the packages can play it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from itertools import product

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.identity import seed_of
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.errors import ManifestError, OptionError, did_you_mean
from pytest_libero_max.events.configurations import PRO_STATES, Cell, Configuration
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.makers.construction.case_selection import Examine, Pool, choose, select
from pytest_libero_max.makers.construction.release import ExamineCases, Examined, Release
from pytest_libero_max.makers.construction.splits import SPLITS, full, protocol
from pytest_libero_max.substrates.contract import Catalogue

BENCHMARK, VERSION = "libero-max-genuine", "1.0.0"
SUBSTRATE = "LIBERO-Plus and LIBERO-PRO"
SAMPLER, SMOKE_SAMPLER = "libero-max-genuine-v1.0", "libero-max-genuine-smoke-v1.0"

SMOKE, MAX = "smoke", "max"
TRACKS = (SMOKE, MAX)
"""Tracks that can be built; ``max`` brings those drawn from it: lite, camera and the recovery tracks."""

SOURCES = ("plus", "pro")


def build_genuine(examine: ExamineCases, catalogue: Catalogue, names: Iterable[str]) -> Release:
    """Choose the cases of some tracks, of :data:`TRACKS`, on genuine scenes.

    Raises:
        ManifestError: There are not enough cases that pass, or LIBERO-Plus's classification is missing.
        OptionError: There is no such track.
    """
    names = tuple(names)
    for name in names:
        if name not in TRACKS:
            raise OptionError.seen("track", name, f" cannot be built. {did_you_mean(name, TRACKS)}")
    examined = Examined(examine)
    unexamined: dict[str, str] = {}
    lacks = {
        (variation.source, variation.suite, variation.index, variation.category): catalogue.lacks(variation)
        for source in SOURCES
        for variation in catalogue.variations(source)
    }

    def failing(cases: Sequence[Case]) -> list[str]:
        for case in cases:
            what = lacks[case.source, case.suite, case.task_index, case.source_category]
            if what:
                unexamined[case.case_id] = what
        return examined.failing([case for case in cases if case.case_id not in unexamined])

    tracks: dict[str, Manifest] = {}
    if SMOKE in names:
        tracks[SMOKE] = select_smoke(failing, candidates_of(catalogue))
    if MAX in names:
        cases = select(failing, Pool(catalogue, SAMPLER))
        whole = full(cases, BENCHMARK, VERSION, SUBSTRATE)
        drawn = {name: split(whole) for name, split in SPLITS.items() if name != SMOKE}
        tracks |= {MAX: whole, **drawn}
    return examined.release(tracks, unexamined)


Candidates = Mapping[str, Sequence[Configuration]]
"""Candidates of smoke: tasks that need no models of LIBERO-Plus, by source, with initial states."""


def candidates_of(catalogue: Catalogue) -> Candidates:
    """Candidates of smoke, the same on every machine with the packages."""
    return {
        source: [
            Configuration(variation, init, catalogue)
            for variation in catalogue.variations(source)
            if not catalogue.lacks(variation, models=False)
            and (source == "pro" or variation.difficulty is not None)
            for init in range(PRO_STATES if source == "pro" else 1)
        ]
        for source in SOURCES
    }


def select_smoke(examine: Examine, candidates: Candidates) -> Manifest:
    """Choose one case of each event, variant and source, and choose again without those that fail.

    Each is the first configuration that was not rejected, in this order: the suite that the source has used
    least, then the source category it has used least, then a hash. A case rejected for a place counts as
    used in it: where one suite has no room for an event, the next ones are tried in turn.
    """
    return _smoke(
        choose(
            examine,
            lambda _, failed: {case.case_id: case for case in propose_smoke(candidates, failed)},
            lambda case: case,
        )
    )


def propose_smoke(candidates: Candidates, failed: Iterable[str] = ()) -> tuple[Case, ...]:
    """Return the 32 cases, sorted by id, none of which is one of ``failed``.

    Raises:
        ManifestError: A slot has no configuration left.
    """
    excluded, cases = set(failed), []
    for source in SOURCES:
        used: Counter[str] = Counter()
        for event, draw in product(sorted(BENCHMARK_EVENTS), (0, 1)):
            chosen = _first(candidates, source, event, draw, excluded, used)
            used.update((chosen.variation.suite, chosen.variation.category))
            cases.append(chosen.case(Cell(chosen.variation.category, event, draw)))
    return tuple(sorted(cases, key=lambda case: case.case_id))


def _first(
    candidates: Candidates, source: str, event: str, draw: int, excluded: Set[str], used: Counter[str]
) -> Configuration:
    """Return the first configuration for a place, in the order of :func:`select_smoke`."""
    ids = {candidate.identity.case_id(event, draw): candidate for candidate in candidates[source]}
    tried = used.copy()
    for name in excluded & ids.keys():
        tried.update((ids[name].variation.suite, ids[name].variation.category))

    def preference(name: str) -> tuple[int, int, int]:
        variation = ids[name].variation
        return tried[variation.suite], tried[variation.category], seed_of(SMOKE_SAMPLER, name)

    for name in sorted(ids.keys() - excluded, key=preference):
        if eligible(event, ids[name].catalogue.metadata(ids[name].variation)):
            return ids[name]
    raise ManifestError(f"{event}, variant {draw}: every configuration of {source} was rejected.")


def _smoke(cases: tuple[Case, ...]) -> Manifest:
    contract = (
        f"{SMOKE_SAMPLER}; one case of each event, variant and source, of the tasks that LIBERO's and "
        "LIBERO-PRO's models are enough for; least used suite of the source, least used source category, "
        "then SHA-256 rank, what was rejected for a place counting as used in it; physical preflight; "
        "independent of policy outcomes"
    )
    return Manifest(f"{BENCHMARK}-{SMOKE}", VERSION, protocol(SMOKE, contract, SUBSTRATE), cases)
