"""The original track: every event and variant twice, on unmodified LIBERO tasks of two suites.

One case of LIBERO-Spatial and one of LIBERO-Object for each of the sixteen, two of LIBERO-Object where
Spatial has no task that can host the event. Each slot takes the first configuration that was not rejected,
in this order: tasks that the track has used least, then initial states it has used least, then a hash.
Configurations are rejected by :mod:`.preflight` alone, for reasons in the ledger beside the
tracks; no outcome of a policy decides. It plays on an installed LIBERO that has neither LIBERO-Plus nor
LIBERO-PRO.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity, seed_of
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible, resolve_event
from pytest_libero_max.makers.construction.case_selection import Examine, choose
from pytest_libero_max.makers.construction.splits import VERSION, protocol
from pytest_libero_max.tasks.contents import TaskMetadata, task_metadata

SUITES = ("libero_spatial", "libero_object")
TASKS = 10
INITS = 10
SAMPLER = "libero-max-smoke-v1.0"
"""Name of the random draws; the track had another name when they were fixed."""

PROTOCOL = protocol(
    "original",
    f"{SAMPLER}; 2 cases per change-type/draw cell, one of each suite where both are eligible; "
    "least used task, least used initial state, then SHA-256 rank; physical preflight; "
    "independent of policy outcomes",
    substrate="LIBERO",
)


def build_original(rejected: Collection[str] = ()) -> Manifest:
    """Select the 32 cases.

    Raises:
        ManifestError: A slot has no configuration left.
    """
    tasks = {(suite, index): task_metadata(suite, index) for suite in SUITES for index in range(TASKS)}
    used_tasks: Counter[tuple[str, int]] = Counter()
    used_inits: Counter[int] = Counter()
    cases: list[Case] = []
    for event in BENCHMARK_EVENTS:
        hosts = [suite for suite in SUITES if any(eligible(event, tasks[suite, i]) for i in range(TASKS))]
        for variant in (0, 1):
            for suite in hosts if len(hosts) == 2 else hosts * 2:
                excluded = {*rejected, *(case.case_id for case in cases)}
                candidates = (
                    identity
                    for identity in _identities(suite, event, tasks)
                    if identity.case_id(event, variant) not in excluded
                )

                def preference(
                    identity: Identity, cell: tuple[str, int] = (event, variant)
                ) -> tuple[int, int, int]:
                    key, init = (identity.suite, identity.task_index), identity.init_state_index
                    return used_tasks[key], used_inits[init], seed_of(SAMPLER, *cell, *key, init)

                identity = min(candidates, key=preference, default=None)
                if identity is None:
                    raise ManifestError(
                        f"{event}, variant {variant}: every configuration of {suite} was rejected."
                    )
                used_tasks[identity.suite, identity.task_index] += 1
                used_inits[identity.init_state_index] += 1
                cases.append(_case(identity, event, variant, tasks[identity.suite, identity.task_index]))
    ordered = tuple(sorted(cases, key=lambda case: case.case_id))
    return Manifest("libero-max-original", VERSION, PROTOCOL, ordered)


def select_original(examine: Examine) -> Manifest:
    """Choose the cases, and choose again without those that fail until none does."""
    cases = choose(
        examine, lambda _, failed: {case.case_id: case for case in build_original(failed)}, lambda case: case
    )
    return Manifest("libero-max-original", VERSION, PROTOCOL, cases)


def _identities(suite: str, event: str, tasks: Mapping[tuple[str, int], TaskMetadata]) -> Iterator[Identity]:
    for index in range(TASKS):
        if eligible(event, tasks[suite, index]):
            for init in range(INITS):
                yield Identity("libero", suite, index, init)


def _case(identity: Identity, event: str, variant: int, task: TaskMetadata) -> Case:
    return parse_case(case_record(identity, resolve_event(event, variant, task, identity), task.name))
