"""A study in a package of its own: the same event before the first query, and half way through."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max import Arm, Entry, Study
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.triggers import AtStart, BudgetFraction

if TYPE_CHECKING:
    from pytest_libero_max import Case, PolicySpec


class PushEarly(Study):
    """Base, Dynamic, and the change at two other moments."""

    name = "push-early"
    title = "When it is pushed"
    track = "smoke"

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        change = change_from_dict(case.event.change).scaled(strength)
        return (
            Arm("early", (Entry(AtStart(), change),)),
            Arm("late", (Entry(BudgetFraction(0.5), change),)),
        )
