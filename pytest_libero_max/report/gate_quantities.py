"""Quantities that gates can ask for, by name: of rows, of sections, of probes and of the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.report import monitors, repeats, safety, timing
from pytest_libero_max.report.measures import Measured
from pytest_libero_max.report.probe_means import probe_key, probe_quantity
from pytest_libero_max.report.quantities import QUANTITIES, Quantity
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Measure

GATED = {column.gate or column.key: column for column in QUANTITIES if column.gate is not None}
"""Quantities of a row of the report, by the name that gates use."""

COUNTS = ("planned", "played", "invalid", "missing", "unsupported")
"""Counts of pairs; decidable in an incomplete run. Those after the second are of the whole run only."""

WHOLE_TRACK = "whole_track"
"""1 where the run planned every case of its track or manifest and its policy supports all, else 0."""

MEASURED = {one.key: one for module in (safety, timing, repeats) for one in module.QUANTITIES}
"""Quantities of the sections of a run, by the name that gates use."""

_WATCHED = {one.key: safety.PROBE for one in safety.QUANTITIES}
_WATCHED |= {one.key: timing.PROBE for one in timing.OF_MOTION}

_MONITOR = "monitor"
"""First part of the names of the quantities of monitors, which are of probes of any name."""

LARGEST = "largest"
"""The largest value of a pair, of a column of a probe, whose mean has no part."""

BEYOND_SHAM = "beyond_sham"
"""Dynamic success less that of the sham event, on the pairs that played it (``noise=sham:SHARE``)."""


def measured_called(name: str) -> Measured | None:
    """Return a quantity of a section; None for another."""
    kind, _, rest = name.partition(".")
    if kind != _MONITOR:
        return MEASURED.get(name)
    row = next((row for key, row in monitors.ROWS.items() if rest.endswith(f".{key}")), None)
    return None if row is None else Measured(name, *row)


def is_of_pairs(name: str) -> bool:
    """Return True for a quantity that follows from how the pairs end, so that its extremes are known."""
    return name in (*COUNTS[1:], *GATED)


def probe_of(name: str) -> str | None:
    """Return the probe that a quantity is measured by; None for one that needs none."""
    kind, _, rest = name.partition(".")
    if kind == _MONITOR:
        return rest.partition(".")[0]
    if name in (*MEASURED, *GATED, *COUNTS, WHOLE_TRACK, BEYOND_SHAM):
        return _WATCHED.get(name)
    return kind


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
    counts = report.pairs
    if not counts.complete:
        return None, f"{counts.played} of {counts.planned} planned pairs of the run were played"
    for section in report.sections.values():
        for measure in section.values():
            if isinstance(measure, Measure) and measure.key == name:
                lack = measure.lack or "no pair to measure it on, or too few for an interval"
                return getattr(measure, end or "value"), lack
    return None, f"the report has no {name}: no pair was played with the probe or study that it needs"
