"""Suites: named sets of tasks with a budget of steps, LIBERO's four and those that other packages add."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_libero_max.errors import ManifestError
from pytest_libero_max.registry import Registry, listed_in

VARIED = ("plus", "pro")
"""Sources of cases that vary LIBERO's tasks. Any other source is the benchmark of an unmodified task."""

LONGEST = 10_000
"""Most policy steps of an episode."""


@dataclass(frozen=True)
class Suite:
    """A set of tasks, of which a case names one by its index.

    Raises:
        ValueError: A value breaks its rule.
    """

    name: str
    """In manifests, markers and results: lower case letters, digits and underscores."""
    budget: int
    """Policy steps an episode may take after the settle steps."""
    benchmark: str
    """Benchmark that it is a part of; begins the ids of its unmodified tasks."""
    label: str
    """Its name within the benchmark, the second part of these ids."""
    tasks: int = 10
    """Number of its tasks."""
    states: int = 10
    """Number of initial states of a task from which cases begin."""

    def __post_init__(self) -> None:
        for name in ("name", "benchmark", "label"):
            word = getattr(self, name)
            if not (isinstance(word, str) and word.isascii() and word.replace("_", "").isalnum()):
                raise ValueError(f"{name}={word!r} of a suite, but must be letters, digits and underscores")
        if self.benchmark in VARIED:
            raise ValueError(f"benchmark={self.benchmark!r} of a suite is the name of a source of variations")
        for name in ("tasks", "states"):
            number = getattr(self, name)
            if not isinstance(number, int) or number < 1:
                raise ValueError(f"{name}={number!r} of suite {self.name!r}, but must be 1 or more")
        if not isinstance(self.budget, int) or not 1 <= self.budget <= LONGEST:
            raise ValueError(
                f"budget={self.budget!r} of suite {self.name!r}, but must be 1 to {LONGEST} steps"
            )


def _accept(name: str, candidate: object) -> Suite:
    if not isinstance(candidate, Suite):
        raise ValueError(f"{candidate!r} is no pytest_libero_max.benchmark.suites.Suite")
    return candidate


SUITES: Registry[Suite] = Registry(
    "suite",
    "pytest_libero_max.suites",
    listed_in("pytest_libero_max.tasks.suites:LIBERO"),
    _accept,
    ManifestError,
    attribute="name",
)
"""Every suite that a case may be of: LIBERO's, then those that installed packages add."""


def longest_budget() -> int:
    """Return the most policy steps that an episode of any suite may take."""
    return max(suite.budget for suite in SUITES.values())
