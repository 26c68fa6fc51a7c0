"""The authors' own Lite, made again from the ids of its cases alone.

An id names task, initial state, event and variant; everything else of a case follows from these by the rules
of this package. The file that comes out is the authors', byte for byte, as its SHA-256 shows.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import product

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.configurations import PRO_STATES, Cell, Configuration
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.makers.construction.splits import protocol
from pytest_libero_max.substrates.contract import Catalogue

_STATES = {"plus": 1, "pro": PRO_STATES}
"""Initial states of a task, by source."""

_PLUS_REVISION, _PRO_REVISION = "4976dc3", "c86fc3b8293185a6f373677018ff3e37f8391602"
"""Commits that the authors name: of LIBERO-Plus, and of the data set of LIBERO-PRO."""


def paper_lite(case_ids: Collection[str], catalogue: Catalogue) -> Manifest:
    """Return the authors' manifest of some of their cases.

    Raises:
        ManifestError: An id is of no case; or LIBERO-Plus's classification is missing.
    """
    cases = _cases(frozenset(case_ids), catalogue)
    unknown = set(case_ids) - cases.keys()
    if unknown:
        raise ManifestError.seen(
            "case_id",
            min(unknown),
            f" is the id of no case, and so are {len(unknown) - 1} more of {len(case_ids)}. Give the "
            "authors' case_index.csv.",
        )
    made_for = protocol(
        "lite", "100 cases per event: 70 LIBERO-Plus + 30 LIBERO-PRO", "LIBERO-Plus + LIBERO-PRO"
    )
    return Manifest(
        "libero-max-lite",
        "3.0.0",
        {**made_for, "source_benchmark_commit": f"{_PLUS_REVISION};{_PRO_REVISION}"},
        tuple(sorted(cases.values(), key=lambda case: (case.event.name, case.source, case.case_id))),
    )


def _cases(case_ids: frozenset[str], catalogue: Catalogue) -> dict[str, Case]:
    """Make the cases of some ids, by id: all ids that there can be are spelled, and compared."""
    cases = {}
    for source, states in _STATES.items():
        for variation, init in product(catalogue.variations(source), range(states)):
            configuration = Configuration(variation, init, catalogue)
            for event, draw in product(BENCHMARK_EVENTS, (0, 1)):
                cell = Cell(variation.category, event, draw)
                case_id = configuration.case_id(cell)
                if case_id in case_ids:
                    cases[case_id] = _with_revision(configuration.case(cell))
    return cases


def _with_revision(case: Case) -> Case:
    """Add the revision of the data set, which a package does not know, to a case of LIBERO-PRO."""
    variant = case.record.get("substrate_variant")
    if variant is None:
        return case
    return replace(
        case, record={**case.record, "substrate_variant": {**variant, "source_revision": _PRO_REVISION}}
    )
