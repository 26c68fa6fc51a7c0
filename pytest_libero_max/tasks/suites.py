"""LIBERO's suites, with the budgets that its evaluations use."""

from __future__ import annotations

from pytest_libero_max.benchmark.suites import Suite

LIBERO = (
    Suite("libero_spatial", 220, "libero", "spatial"),
    Suite("libero_object", 280, "libero", "object"),
    Suite("libero_goal", 300, "libero", "goal"),
    Suite("libero_10", 520, "libero", "10"),
)
"""The suites, in LIBERO's order."""

LIBERO_SUITES = tuple(suite.name for suite in LIBERO)
"""Their names."""
