"""Requirements of a meaningful paired change: Base successes that can be lost, and events that happened."""

from __future__ import annotations

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import PairCounts, Report
from pytest_libero_max.stats.blocks import FLOOR_BASE_RATE, Result

NOT_MEASURABLE = "Not measurable"
"""Headline in place of a paired change that nothing was there to make."""

LEAST_FIRED = 0.5
"""Share of the pairs in which the event must happen for their paired change to be of the event."""


def lacks_of(row: Result) -> list[str]:
    """Return why the change of a set of pairs says almost nothing about the event; empty otherwise."""
    base, fired = row.base_success, row.trigger_coverage
    lacks = []
    if base.value is not None and base.value < FLOOR_BASE_RATE:
        few = (
            f" (below {FLOOR_BASE_RATE:.0%}), so events have little"
            if base.count
            else ", so events have nothing"
        )
        lacks.append(f"Base solves {base.count} of {counted(base.of, 'pair')}{few} to break")
    if fired.value is not None and fired.value < LEAST_FIRED:
        few = f" (below {LEAST_FIRED:.0%})" if fired.count else ""
        without = "in the others Dynamic equals Base" if fired.count else "Dynamic equals Base"
        lacks.append(f"the event happened in {fired.count} of {counted(fired.of, 'pair')}{few}: {without}")
    return lacks


def is_measurable(row: Result) -> bool:
    """Return False where no pair can show what the event does: Base solves none, or it never happened."""
    return bool(row.base_success.count and row.trigger_coverage.count)


def lack_of_run(report: Report) -> str:
    """Return why the change of a run is not decided: it is incomplete, or says nothing; empty where it is."""
    if not report.pairs.complete:
        return played_text(report.pairs)
    return "; ".join(lacks_of(report.overall))


def played_text(pairs: PairCounts) -> str:
    """Return the clause on a run that lacks pairs."""
    return f"{pairs.played} of {pairs.planned} planned pairs of the run were played"


def warning_of(row: Result) -> str | None:
    """Return the warning that belongs beside the change of a whole run; None where it needs none."""
    lacks = lacks_of(row)
    if not lacks:
        return None
    return (
        f"{'The paired change shows little' if is_measurable(row) else NOT_MEASURABLE}: {'; '.join(lacks)}."
    )
