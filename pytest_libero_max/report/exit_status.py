"""Exit statuses of this package, for pytest and ``libero-max gate``."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_libero_max.report.report_document import PairCounts


GATE_FAILED = 10
"""Exit status of a complete run in which a gate does not hold."""

INCOMPLETE = 11
"""Exit status of a run with an invalid pair, with a missing pair that no stopping rule left out, or with a
report that could not be written."""


def ended_as_declared(pairs: PairCounts) -> bool:
    """Return True if all pairs of a run are measured, or all but those that its stopping rule left out."""
    by_rule = pairs.stopped is not None and pairs.stopped.rule is not None
    return pairs.complete or (by_rule and not pairs.invalid and not pairs.missing_shards)
