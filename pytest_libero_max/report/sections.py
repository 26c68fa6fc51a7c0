"""Sections of a report: titles with tables of names and values, to which a user's hook may add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import msgspec

from pytest_libero_max.benchmark.documents import Json, canonical_json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report import probe_means, repeats, timing
from pytest_libero_max.report.measures import Rows, section_rows
from pytest_libero_max.report.probe_means import probe_quantities
from pytest_libero_max.report.report_document import Report

NOTES: Mapping[str, str] = {timing.TITLE: timing.NOTE, repeats.TITLE: repeats.NOTE}
"""Help for reading a section, by its title."""


class ShownSection(NamedTuple):
    """A section as writers print it."""

    title: str
    """Heading."""
    note: str
    """Help for reading it; empty for none."""
    rows: Sequence[tuple[str, object]]
    """Names and values."""


def shown_sections(report: Report) -> list[ShownSection]:
    """Return the sections of a report, and the columns of probes over all pairs."""
    sections = [
        ShownSection(title, NOTES.get(title, ""), section_rows(values))
        for title, values in report.sections.items()
    ]
    columns = [(one.title, one.long(report.overall)) for one in probe_quantities([report.overall])]
    return [*sections, *([ShownSection(probe_means.TITLE, "", columns)] if columns else [])]


def with_sections(report: Report, amended: Json) -> Report:
    """Return the report with the sections of its amended copy.

    Args:
        report: As computed from the pairs.
        amended: A copy of plain values that a hook was given; only its ``sections`` may differ.

    Raises:
        ReportError: Something else differs, or a section is not a table of names and plain values.
    """
    computed: Json = msgspec.to_builtins(report)
    changed = [
        key for key in {**computed, **amended} if key != "sections" and _differs(computed, amended, key)
    ]
    if changed:
        raise ReportError(
            f"pytest_libero_max_report changed {', '.join(sorted(changed))}, but may only add to "
            "report['sections']: every other number is computed from pairs.jsonl alone."
        )
    sections = amended.get("sections")
    if not isinstance(sections, dict):
        raise ReportError(f"report['sections']={sections!r}, but must be a dict of titles to tables.")
    for title, table in sections.items():
        if not isinstance(title, str) or not title or not isinstance(table, dict):
            raise ReportError(
                f"report['sections'][{title!r}]={table!r}, but must be a title with a dict of values by name."
            )
        own = computed["sections"].get(title, {})
        for name, value in table.items():
            if isinstance(value, dict) and value == own.get(name):
                continue
            plain = value is None or isinstance(value, str | bool | int)
            if not isinstance(name, str) or not (plain or (isinstance(value, float) and isfinite(value))):
                raise ReportError(
                    f"report['sections'][{title!r}][{name!r}]={value!r}, but must be a name with a text, a "
                    "finite number, true, false or null."
                )
    return msgspec.structs.replace(report, sections=msgspec.convert(sections, dict[str, Rows]))


def _differs(report: Json, amended: Json, key: str) -> bool:
    if key not in report or key not in amended:
        return True
    try:
        return canonical_json(amended[key]) != canonical_json(report[key])
    except (TypeError, ValueError):  # not JSON, so a hook has put it there
        return True
