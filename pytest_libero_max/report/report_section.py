"""The contract of a report section: what it computes from the pairs of a run, and how that is shown.

A section is one class, under its name in the entry-point group ``pytest_libero_max.sections``. No renderer
and no gate knows it: its numbers are measures of ``report.sections``, which gates ask for by their keys, and
what people see of them is a :class:`~pytest_libero_max.report.document.Section`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.document import Section
from pytest_libero_max.report.measures import Measured, Rows
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Measure


@dataclass(frozen=True)
class PlayedPairs:
    """The pairs of a run that were played, from which sections are computed."""

    records: Sequence[PairRecord]
    """In the order of their case ids."""
    tasks: Sequence[str] = ()
    """The reference task of each."""
    protocol: Json = field(default_factory=dict)
    """Settings of the run that differ from the usual ones, as its header has them."""
    with_intervals: bool = True
    """False where a rule has ended the run: intervals are for a fixed number of pairs."""


class Chance(NamedTuple):
    """Pairs that ended otherwise by chance alone."""

    measured_by: str
    """What was played to know it, in words."""
    lost: int
    gained: int
    pairs: int
    """Number of pairs among which they were counted."""


class ReportSection(ABC):
    """A part of the report that is computed from the pairs of a run."""

    name: ClassVar[str]
    quantities: ClassVar[Sequence[Measured]] = ()
    """Numbers that it can have, which gates ask for."""
    option: ClassVar[str] = ""
    """Option by which a run measures them, for example ``--libero-max-study=repeats``; empty for none."""
    notes: ClassVar[Mapping[str, str]] = {}
    """Help for reading its tables, by their titles."""
    interval_notes: ClassVar[Mapping[str, str]] = {}
    """Help for reading the intervals of its tables, by their titles; shown where a table has one."""

    @abstractmethod
    def tables(self, played: PlayedPairs) -> Mapping[str, Rows]:
        """Return what ``report.sections`` stores: names and values by title; empty without such pairs."""

    def quantity(self, name: str) -> Measured | None:
        """Return the number that a gate asks for; None where it is none of this section."""
        return next((one for one in self.quantities if one.key == name), None)

    def shown(self, report: Report) -> Mapping[str, Section]:
        """Return sections to show in place of tables of names and values, by title; none by default."""
        return {}

    def warnings(self, report: Report) -> Sequence[str]:
        """Return what has to be known before any number, as sentences; none by default."""
        return ()

    def chance(self, measures: Mapping[str, Measure]) -> Chance | None:
        """Return the pairs that changed without an event, of a section that measures it.

        Args:
            measures: Numbers of the report's sections, by the names that gates use.
        """
        return None
