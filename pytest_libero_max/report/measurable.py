"""Requirements of a meaningful paired change: Base successes that can be lost, and events that happened."""

from __future__ import annotations

from pytest_libero_max.report.formats import count_text
from pytest_libero_max.report.report_document import PairCounts, Report
from pytest_libero_max.stats.blocks import Result
from pytest_libero_max.stats.outcome_table import FLOOR_BASE_RATE

LEAST_FIRED = 0.5
"""Share of the pairs in which the event must happen for their paired change to be of the event."""


def lacks_of(row: Result) -> list[str]:
    """Return why the change of a set of pairs says almost nothing about the event; empty otherwise.

    Args:
        row: Result of the pairs.

    Returns:
        Clauses without a period.
    """
    base, fired = row.base_success, row.trigger_coverage
    lacks = []
    if base.value is not None and base.value < FLOOR_BASE_RATE:
        lacks.append(
            f"Base succeeds in {count_text(base)} pairs, and below {FLOOR_BASE_RATE:.0%} there is next to "
            "nothing to lose"
        )
    if fired.value is not None and fired.value < LEAST_FIRED:
        lacks.append(
            f"the event happened in {count_text(fired)} pairs, and below {LEAST_FIRED:.0%} most of Dynamic "
            "is Base"
        )
    return lacks


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
    return f"The paired change says next to nothing of the event here: {'; '.join(lacks)}."
