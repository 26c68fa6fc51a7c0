"""Event timing: the same change before the first query, or while the policy acts, for every event."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.schedules import Arm, Entry, change_of
from pytest_libero_max.events.triggers import AtStart
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec

RESET = "reset"


class EventTiming(Study):
    """Base; Reset, in which the event has happened before the policy's first query; Dynamic.

    Reset less Base is what the changed scene costs, Dynamic less Reset what the change in the middle adds.
    """

    name = "event-timing"
    title = "Event timing"
    track = "lite"

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """Return the arm Reset."""
        return (Arm(RESET, (Entry(AtStart(), change_of(case, strength)),)),)
