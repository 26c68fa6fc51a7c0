"""Sections of a report: those that packages add by entry points, and tables that a user's hook adds."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, TypeVar

import msgspec

from pytest_libero_max.benchmark.documents import Json, canonical_json
from pytest_libero_max.errors import OptionError, ReportError, did_you_mean
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.registry import Registry, references
from pytest_libero_max.report import probe_means
from pytest_libero_max.report.document import Section, Table
from pytest_libero_max.report.measures import UNITS, Measured, Rows, measures_of, rows_table
from pytest_libero_max.report.probe_means import probe_quantities
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Measure, Text


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


T = TypeVar("T")


def _accept(name: str, kind: object) -> ReportSection:
    if not (isinstance(kind, type) and issubclass(kind, ReportSection)) or inspect.isabstract(kind):
        raise ValueError(f"{kind!r} is not a subclass of pytest_libero_max.ReportSection with tables()")
    section = kind()
    for one in section.quantities:
        if one.unit not in UNITS:
            raise ValueError(f"{one.key} has unit={one.unit!r}. {did_you_mean(one.unit, UNITS)}")
    return section


SECTIONS: Registry[ReportSection] = Registry(
    "report section",
    "pytest_libero_max.sections",
    references("pytest_libero_max.report", lambda: {"timing": "timing:Timing"}),
    _accept,
    OptionError,
    attribute="name",
)
"""The sections of every report by name: this package's, then those that installed packages add."""


def _of_each(ask: Callable[[ReportSection], Mapping[str, T]]) -> dict[str, T]:
    """Return what the sections answer, by title.

    Raises:
        ReportError: A section fails, or two have one title.
    """
    answers: dict[str, T] = {}
    for name, section in SECTIONS.items():
        try:
            answer = ask(section)
        except Exception as error:  # somebody else's code may raise anything
            raise ReportError(
                f"The report section {name!r} failed ({type(error).__name__}: {error}). Repair the package "
                "that adds it or uninstall it, and compute the report again."
            ) from error
        if both := answers.keys() & answer.keys():
            raise ReportError(
                f"The report section {name!r} has the title {min(both)!r}, which another one has. Rename it, "
                "or uninstall one of the packages."
            )
        answers |= answer
    return answers


def measured_sections(played: PlayedPairs) -> dict[str, Rows]:
    """Return what ``report.sections`` stores, of every section that has something to say of these pairs."""
    return _of_each(lambda section: section.tables(played))


def shown_sections(report: Report) -> list[Section]:
    """Return the sections of a report as they are shown, and the columns of probes over all pairs."""
    own, notes = _of_each(lambda section: section.shown(report)), _of_each(lambda section: section.notes)
    on_intervals = _of_each(lambda section: section.interval_notes)
    sections = []
    for title, rows in report.sections.items():
        table = rows_table(rows).explaining_intervals(on_intervals.get(title, ""))
        sections.append(own.get(title) or Section(title, [table], lead=notes.get(title, "")))
    columns = [(one.title, one.cell(report.overall)) for one in probe_quantities([report.overall])]
    if columns:
        sections.append(Section(probe_means.TITLE, [Table("", ("Name", "Value"), columns)]))
    return sections


def main_measures(report: Report) -> list[tuple[str, Measure]]:
    """Return the numbers of sections that have a line in the terminal, each with its title there."""
    measures = measures_of(report.sections)
    return [
        (one.line, measures[one.key])
        for section in SECTIONS.values()
        for one in section.quantities
        if one.line and one.key in measures
    ]


def section_warnings(report: Report) -> list[str]:
    """Return what sections say has to be known before any number."""
    warnings = _of_each(lambda section: {section.name: section.warnings(report)})
    return [text for texts in warnings.values() for text in texts]


def with_sections(report: Report, amended: Json) -> Report:
    """Return the report with the sections of its amended copy.

    Args:
        amended: A copy of plain values that a hook was given; only its ``sections`` may differ.

    Raises:
        ReportError: Something else differs, a section that was computed among it, or an added section is no
            table of names and plain values.
    """
    computed: Json = msgspec.to_builtins(report)
    sections = amended.get("sections")
    if not isinstance(sections, dict):
        raise ReportError(f"report['sections']={sections!r}, but must be a dict of titles to tables.")
    own, others = computed["sections"], computed.keys() | amended.keys()
    changed = [key for key in sorted(others - {"sections"}) if _differs(computed, amended, key)]
    changed += [f"report['sections'][{title!r}]" for title in own if _differs(own, sections, title)]
    if changed:
        raise ReportError(
            f"pytest_libero_max_report changed {', '.join(changed)}, but may only add rows to "
            "report['sections'] under a title of its own: all else is computed from pairs.jsonl alone."
        )
    rows: dict[str, Rows] = {}
    for title, table in sections.items():
        try:
            canonical_json(table)  # which knows no infinite number
            rows |= msgspec.convert({title: table}, dict[Text, Rows])
        except (TypeError, ValueError) as error:
            raise ReportError(
                f"report['sections'][{title!r}]={table!r}: {error}. A section is a title with a dict of "
                "names to a text, a finite number, true, false or null."
            ) from None
    return msgspec.structs.replace(report, sections=rows)


def _differs(report: Json, amended: Json, key: str) -> bool:
    if key not in report or key not in amended:
        return True
    try:
        return canonical_json(amended[key]) != canonical_json(report[key])
    except (TypeError, ValueError):  # not JSON, so a hook has put it there
        return True
