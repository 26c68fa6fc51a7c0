"""Exit statuses of this package, for pytest and ``libero-max gate``."""

from __future__ import annotations

GATE_FAILED = 10
"""Exit status of a complete run of which a gate does not hold."""

INCOMPLETE = 11
"""Exit status of a run with a missing or invalid pair, or with a report that could not be written."""
