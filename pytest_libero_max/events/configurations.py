"""Configurations that can host an event: a source variation with an initial state, and the case of each."""

from __future__ import annotations

from typing import NamedTuple

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Draw, Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.substrates.contract import Catalogue
from pytest_libero_max.substrates.registry import own_catalogue
from pytest_libero_max.substrates.variation import Variation

PRO_STATES = 10
"""Initial states of a LIBERO-PRO task; LIBERO-Plus has one, number 0."""


OWN: Catalogue = own_catalogue()
"""The default: this package's own variations."""


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
    catalogue: Catalogue = OWN
    draw: Draw | None = None
    """The fresh draw that a case of it belongs to; None for the frozen tracks."""

    @property
    def identity(self) -> Identity:
        variation = self.variation
        category = variation.category if variation.source == "pro" else ""
        return Identity(variation.source, variation.suite, variation.index, self.init, category, self.draw)

    def case_id(self, cell: Cell) -> str:
        """Id of the case that :meth:`case` makes."""
        return self.identity.case_id(cell.event, cell.draw)

    def case(self, cell: Cell) -> Case:
        """Return the case of a cell on this configuration, or raise ManifestError."""
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
    """Return the cell a case belongs to."""
    return Cell(case.source_category, case.event.name, case.event.variant)
