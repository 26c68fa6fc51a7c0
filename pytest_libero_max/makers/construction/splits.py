"""The smaller tracks, drawn from the frozen 8,000 cases: functions of that manifest alone."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle, islice, product

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import seed_of
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.programs import Program, find_program
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.runs.plan import task_number
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES, PRO_CATEGORIES

SUBSTRATE = "pytest-libero-max embedded"
BENCHMARK, VERSION = "libero-max-embedded", "2.0.0"

LITE_SEED = 20260830
LITE_PER_EVENT = {"plus": 70, "pro": 30}

SMOKE_SAMPLER = "libero-max-embedded-smoke-v2.0"

BEYOND_SAMPLER = "libero-max-embedded-beyond-v1.0"
BEYOND_PER_PROGRAM = 48
BEYOND_PROGRAMS = (
    *("above", "blackout", "compound", "dropped", "frozen", "instruction_switch", "later"),
    *("moving", "nudge", "recurrent", "slip", "there_and_back", "transient"),
)

DEVELOPMENT = 16
SAMPLER = "libero-max-embedded-recovery-v1.0"


def protocol(profile: str, contract: str, substrate: str = SUBSTRATE) -> Json:
    """Return the protocol of a track, as manifests spell it."""
    return {
        "arms": ["control", "intervention"],
        "profile": profile,
        "query_interval": 16,
        "scoring_track": "physical_completion",
        "selection_contract": contract,
        "substrate": substrate,
    }


def full(
    cases: Iterable[Case], benchmark: str = BENCHMARK, version: str = VERSION, substrate: str = SUBSTRATE
) -> Manifest:
    """Return the manifest of all cases, sorted by id."""
    contract = (
        "Plus: 7 categories x 8 events x 2 variants x 50 tasks; PRO: 10 x 8 x 2 x 15 configurations; "
        "physical preflight with replacement in the cell; independent of policy outcomes"
    )
    return Manifest(benchmark, version, protocol("max", contract, substrate), _by_id(cases))


def lite(whole: Manifest) -> Manifest:
    """100 cases of each event, 70 from LIBERO-Plus and 30 from LIBERO-PRO, drawn as the authors draw them."""
    draw = random.Random(LITE_SEED)
    chosen: list[Case] = []
    for event, (source, count) in product(sorted(BENCHMARK_EVENTS), LITE_PER_EVENT.items()):
        pool = (case for case in whole if case.event.name == event and case.source == source)
        chosen += _by_id(draw.sample(_by_id(pool), count))
    contract = f"100 cases of each event: 70 LIBERO-Plus and 30 LIBERO-PRO; seed {LITE_SEED}"
    return _split(whole, "lite", contract, chosen)


def smoke(whole: Manifest) -> Manifest:
    """One case of each event, variant and source: 32 cases over all suites.

    Each is the case whose suite, then source category the track has used least so far, counted for each
    source on its own; a hash decides between equals.
    """
    used: Counter[object] = Counter()
    chosen: list[Case] = []
    for source, event, variant in product(LITE_PER_EVENT, sorted(BENCHMARK_EVENTS), (0, 1)):
        pool = (
            case
            for case in whole
            if (case.source, case.event.name, case.event.variant) == (source, event, variant)
        )
        best = min(pool, key=lambda case: (*(used[key] for key in _spread(case)), _smoke_rank(case)))
        used.update(_spread(best))
        chosen.append(best)
    contract = (
        f"{SMOKE_SAMPLER}; one case of each event, variant and source; least used suite of the source, "
        "least used source category, then SHA-256 rank"
    )
    return _split(whole, "smoke", contract, _by_id(chosen))


def _spread(case: Case) -> tuple[tuple[str, str], tuple[str, str]]:
    """Properties over which the smoke track spreads its cases, the most important first."""
    return (case.source, case.suite), (case.source, case.source_category)


def _smoke_rank(case: Case) -> int:
    return seed_of(SMOKE_SAMPLER, case.case_id)


def camera(whole: Manifest) -> Manifest:
    """Every camera shift."""
    cases = (case for case in whole if case.event.name == "camera_shift")
    return _split(whole, "camera", "every camera_shift", cases)


def recovery(whole: Manifest) -> Manifest:
    """300 sensor-noise cases: 210 Plus and 90 PRO, 150 of each corruption, spread over source categories."""
    chosen: list[Case] = []
    for category, variant, count in _recovery_cells():
        pool = (
            case
            for case in whole
            if case.event.name == "sensor_noise_onset"
            and (case.source_category, case.event.variant) == (category, variant)
        )
        chosen += sorted(pool, key=_rank)[:count]
    contract = f"{SAMPLER}; 210 LIBERO-Plus and 90 LIBERO-PRO, 150 of each corruption, by source category"
    return _split(whole, "recovery", contract, _by_id(chosen))


def _recovery_cells() -> Iterator[tuple[str, int, int]]:
    """Source category, corruption variant, number of cases: 15 for Plus, 4 and 5 in turns for PRO."""
    for category in PLUS_CATEGORIES:
        yield from ((category, variant, 15) for variant in (0, 1))
    for number, category in enumerate(PRO_CATEGORIES):
        yield from ((category, variant, 4 + (number + variant) % 2) for variant in (0, 1))


def _rank(case: Case) -> int:
    return seed_of(SAMPLER, case.case_id)


def recovery_development(whole: Manifest) -> Manifest:
    """16 sensor-noise cases to try things out on, none of which is in :func:`recovery`."""
    formal = {case.case_id for case in recovery(whole)}
    pool = [case for case in whole if case.event.name == "sensor_noise_onset" and case.case_id not in formal]
    chosen: list[Case] = []
    for variant in (0, 1):
        ranked = sorted((case for case in pool if case.event.variant == variant), key=_rank)
        spread: dict[str, Case] = {}
        for case in ranked:
            spread.setdefault(case.source_category, case)
        chosen += list(spread.values())[: DEVELOPMENT // 2]
    contract = f"{SAMPLER}; disjoint from the recovery track"
    return _split(whole, "recovery_development", contract, _by_id(chosen))


def beyond(whole: Manifest) -> Manifest:
    """48 cases of each program of the package, spread over suites, tasks, events and source categories.

    A program's cases are drawn one by one, from its suites by turns: of the task that the program has used
    least, the case whose event and variant, then source category, it has used least; a hash decides between
    equals. No case is drawn twice. The id of a case ends with the name of its program.
    """
    tasks = {case.case_id: f"{case.suite}/{task_number(case)}" for case in whole}
    ranks = {case.case_id: seed_of(BEYOND_SAMPLER, case.case_id) for case in whole}
    taken: set[str] = set()
    chosen: list[Case] = []
    for program in map(find_program, BEYOND_PROGRAMS):
        pool: dict[str, dict[str, list[Case]]] = {}
        for case in whole:
            if case.case_id not in taken and case.fits(program):
                pool.setdefault(case.suite, {}).setdefault(tasks[case.case_id], []).append(case)
        used: Counter[object] = Counter()
        for suite in islice(cycle(sorted(pool)), BEYOND_PER_PROGRAM):
            task = min(
                pool[suite], key=lambda task: (used[task], seed_of(BEYOND_SAMPLER, program.name, task))
            )
            best = min(
                pool[suite][task],
                key=lambda case: (used[_event(case)], used[case.source_category], ranks[case.case_id]),
            )
            pool[suite][task].remove(best)
            if not pool[suite][task]:
                del pool[suite][task]
            used.update((task, _event(best), best.source_category))
            taken.add(best.case_id)
            chosen.append(_named(best.playing(program)))
    contract = (
        f"{BEYOND_SAMPLER}; {BEYOND_PER_PROGRAM} cases of each program, from its suites by turns; least used "
        "task of the program, least used event and variant, least used source category, then SHA-256 rank; "
        "examined for the event alone, not for the program"
    )
    return _split(whole, "beyond", contract, _by_id(chosen))


def _event(case: Case) -> tuple[str, int]:
    return case.event.name, case.event.variant


def _named(case: Case) -> Case:
    case_id = own_case_id(case.case_id, case.program)
    return replace(case, case_id=case_id, record={**case.record, "case_id": case_id})


def own_case_id(case_id: str, program: Program | None) -> str:
    """Return the id of a case that plays a program: another one than that of the case without it."""
    return case_id if program is None else f"{case_id}-{program.name}"


def _split(whole: Manifest, name: str, contract: str, cases: Iterable[Case]) -> Manifest:
    made_for = protocol(name, contract, whole.protocol["substrate"])
    return Manifest(f"{whole.benchmark_id}-{name}", whole.version, made_for, tuple(cases))


def _by_id(cases: Iterable[Case]) -> tuple[Case, ...]:
    return tuple(sorted(cases, key=lambda case: case.case_id))


SPLITS: Mapping[str, Callable[[Manifest], Manifest]] = {
    "smoke": smoke,
    "lite": lite,
    "beyond": beyond,
    "camera": camera,
    "recovery": recovery,
    "recovery_development": recovery_development,
}
"""The tracks that follow from ``max``, by name."""
