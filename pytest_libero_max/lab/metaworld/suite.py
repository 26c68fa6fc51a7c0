"""The suite of the fifty tasks."""

from __future__ import annotations

from pytest_libero_max.benchmark.suites import Suite

MT50 = Suite("metaworld_mt50", 500, "metaworld", "mt50", tasks=50, states=50)
"""Meta-World's own number of steps; its initial states are drawn from the seeds 0 to 49."""
