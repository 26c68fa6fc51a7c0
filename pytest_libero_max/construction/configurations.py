"""Configurations that can host an event: a source variation with an initial state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from functools import cache
from typing import NamedTuple, Protocol

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible, resolve_event
from pytest_libero_max.substrates.embedded.catalogue.counts import CATEGORIES as PLUS_CATEGORIES
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import CATEGORIES as PRO_CATEGORIES
from pytest_libero_max.substrates.lookup import catalogue, variation_metadata
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.contents import TaskMetadata

PRO_STATES = 10
"""Initial states of a LIBERO-PRO task; LIBERO-Plus has one, number 0."""


class Catalogue(Hashable, Protocol):
    """Origin of variations: the embedded scenes, or an installation."""

    def variations(self, source: str) -> tuple[Variation, ...]:
        """Every variation of ``plus`` or ``pro``, in order."""
        ...

    def metadata(self, variation: Variation) -> TaskMetadata:
        """Return the contents of a variation's scene."""
        ...

    def variant(self, variation: Variation) -> Json | None:
        """Return the manifest's ``substrate_variant`` of it, if any."""
        ...


class _Embedded:
    """The package's own catalogues."""

    def variations(self, source: str) -> tuple[Variation, ...]:
        return catalogue(source)

    def metadata(self, variation: Variation) -> TaskMetadata:
        return variation_metadata(variation)

    def variant(self, variation: Variation) -> Json | None:
        return None


EMBEDDED: Catalogue = _Embedded()


class Cell(NamedTuple):
    """Parts of the benchmark that have equally many cases."""

    category: str
    event: str
    draw: int

    def __str__(self) -> str:
        return f"{self.category}, {self.event}, variant {self.draw}"


class Configuration(NamedTuple):
    """A source variation with an initial state."""

    variation: Variation
    init: int
    catalogue: Catalogue = EMBEDDED

    @property
    def identity(self) -> Identity:
        variation = self.variation
        category = variation.category if variation.source == "pro" else ""
        return Identity(variation.source, variation.suite, variation.index, self.init, category)

    def case_id(self, cell: Cell) -> str:
        """Id of the case that :meth:`case` makes."""
        return self.identity.case_id(cell.event, cell.draw)

    def case(self, cell: Cell) -> Case:
        """The case of a cell on this configuration.

        Raises:
            ManifestError: The scene lacks what the event needs.
        """
        variation, identity = self.variation, self.identity
        event = resolve_event(cell.event, cell.draw, self.catalogue.metadata(variation), identity)
        record = case_record(identity, event, variation.name)
        prefix = "LIBERO-PRO/" if variation.source == "pro" else ""
        record["substrate_category"] = prefix + variation.category
        record["substrate_difficulty"] = variation.difficulty
        variant = self.catalogue.variant(variation)
        if variant is not None:
            record["substrate_variant"] = variant
        return parse_case(record)


def cell_of(case: Case) -> Cell:
    """The cell a case belongs to."""
    return Cell(case.source_category, case.event.name, case.event.variant)


@cache
def hosts(
    source: str, category: str, origin: Catalogue = EMBEDDED
) -> tuple[tuple[Variation, frozenset[str]], ...]:
    """The variations of a source category, each with the events that its scene can host.

    LIBERO-Plus's variations without a difficulty are left out, as in the released benchmark.
    """
    return tuple(
        (variation, _events_of(origin.metadata(variation)))
        for variation in origin.variations(source)
        if variation.category == category and (source == "pro" or variation.difficulty is not None)
    )


def _events_of(task: TaskMetadata) -> frozenset[str]:
    """The benchmark's events that a scene can host; those of other packages have no part in it."""
    return frozenset(event for event in BENCHMARK_EVENTS if eligible(event, task))


def eligibility_lines(origin: Catalogue = EMBEDDED) -> list[str]:
    """Lines on the number of variations of each source category that can host each event."""
    lines = [
        f"{'category':<30}{'tasks':>7}" + "".join(f"{event.split('_')[0]:>12}" for event in BENCHMARK_EVENTS)
    ]
    for source, categories in (("plus", PLUS_CATEGORIES), ("pro", PRO_CATEGORIES)):
        total = Counter[str]()
        for category in categories:
            found = hosts(source, category, origin)
            count = Counter(event for _, events in found for event in events)
            lines.append(_counts(category, len(found), count))
            total += count + Counter(tasks=len(found))
        lines.append(_counts(f"all of {source}", total["tasks"], total))
    return lines


def _counts(name: str, tasks: int, count: Counter[str]) -> str:
    return f"{name:<30}{tasks:>7}" + "".join(f"{count[event]:>12}" for event in BENCHMARK_EVENTS)
