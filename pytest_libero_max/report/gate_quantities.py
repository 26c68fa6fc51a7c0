"""Quantities that gates can ask for, by name: of rows, of sections, of probes and of the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.report.measurable import lacks_of, played_text
from pytest_libero_max.report.measures import Measured, measures_of
from pytest_libero_max.report.probe_means import probe_key, probe_quantity
from pytest_libero_max.report.quantities import INTERVAL_MARK, QUANTITIES, Quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import SECTIONS, ReportSection

GATED = {column.gate or column.key: column for column in QUANTITIES if column.gate is not None}
"""Quantities of a row of the report, by the name that gates use."""

OTHER_NAMES = {
    name.removesuffix(INTERVAL_MARK).replace(" ", "_").lower(): gate
    for gate, column in reversed(GATED.items())
    for name in (column.heading, column.key)
    if name
}
"""Names of gates by the names that the same quantities have in files and tables; of equal names the first."""

COUNTS = ("planned", "played", "invalid", "missing", "unsupported")
"""Counts of pairs; decidable in an incomplete run. Those after the second are of the whole run only."""

WHOLE_TRACK = "whole_track"
"""1 where the run planned every case of its track or manifest and its policy supports all, else 0."""

LARGEST = "largest"
"""The largest value of a pair, of a column of a probe, whose mean has no part."""


def section_quantities() -> dict[str, Measured]:
    """Return the quantities of the sections of a run that have a fixed name, by the name that gates use."""
    return {one.key: one for section in SECTIONS.values() for one in section.quantities}


def section_of(name: str) -> tuple[ReportSection, Measured] | None:
    """Return the section that a quantity is of, and the quantity; None for one of no section."""
    candidates = ((section, section.quantity(name)) for section in SECTIONS.values())
    return next(((section, measured) for section, measured in candidates if measured is not None), None)


def is_of_pairs(name: str) -> bool:
    """Return True for a quantity that follows from how the pairs end, so that its extremes are known."""
    return name in (*COUNTS[1:], *GATED)


def probe_of(name: str) -> str | None:
    """Return the probe that a quantity is measured by; None for one that needs none."""
    if (place := section_of(name)) is not None:
        return place[1].probe or None
    return None if name in (*GATED, *COUNTS, WHOLE_TRACK) else name.partition(".")[0]


def probe_column(parts: Sequence[str], text: str) -> tuple[str, str | None] | None:
    """Return the key of a column of a probe, and the part of it; None where the name is of no probe."""
    part = LARGEST if parts[-1] == LARGEST else None
    key = probe_key(".".join(parts[:-1] if part else parts), text)
    return None if key is None else (key, part)


def row_quantity(name: str) -> Quantity[Any]:
    """Return a quantity of a set of pairs: what follows from how they end, or a column of a probe."""
    return GATED[name] if name in GATED else probe_quantity(name)


def section_value(name: str, end: str | None, report: Report) -> tuple[float | None, str]:
    """Return a quantity of a section, or the end of its interval; or None, and the reason it is not known."""
    place = section_of(name)
    assert place is not None
    section, measured = place
    if not report.pairs.complete:
        return None, played_text(report.pairs)
    measure = measures_of(report.sections).get(name)
    if measure is None:
        option = f"--libero-max-probe={measured.probe}" if measured.probe else section.option
        return None, f"no pair has {name}{f'. Add {option}' if option else ''}"
    if measured.of_change and (lacks := lacks_of(report.overall)):
        return None, "; ".join(lacks)
    lack = measure.lack or "no pair to measure it on, or too few for an interval"
    return getattr(measure, end or "value"), lack
