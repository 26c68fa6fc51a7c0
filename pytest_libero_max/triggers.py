"""Triggers that come with the package: rules that say at which step an entry of a schedule happens."""

from __future__ import annotations

from pytest_libero_max.events.triggers import (
    Above,
    AfterGrasp,
    AtStart,
    BudgetFraction,
    Proximity,
    StepsAfter,
    Untouched,
)

__all__ = ["Above", "AfterGrasp", "AtStart", "BudgetFraction", "Proximity", "StepsAfter", "Untouched"]
