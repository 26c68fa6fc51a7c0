"""Names and seeds of cases: functions of their content, never of when or where they were made."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pytest_libero_max.benchmark.suites import SUITES, VARIED

SAMPLERS: Mapping[str, str] = MappingProxyType(
    {
        "plus": "libero-max-hard-v2.0",
        "pro": "libero-max-pro-hard-v1.0",
        "libero": "libero-max-base-v1.0",
    }
)
"""Names of the random draws, by source. Those of ``plus`` and ``pro`` are the released benchmark's; that of
another benchmark's unmodified tasks follows from its name."""

DIRECTION_SAMPLER = SAMPLERS["plus"]
"""Relocation directions use one name for every source, so that all variations of a task share them."""

POLICY_SEED = 195
"""Seed of the policy in the frozen tracks."""

FROZEN_STATES = range(10)
"""Initial states of each task that frozen cases begin from."""

TRAINING_STATES = range(10, 50)
"""Initial states of each task that no frozen case begins from, on the embedded scenes: for training data."""


def seed_of(*parts: object) -> int:
    """Return the first 32 bits of SHA-256 of the parts joined by ``|``."""
    return int(hashlib.sha256("|".join(str(part) for part in parts).encode()).hexdigest()[:8], 16)


@dataclass(frozen=True)
class Draw:
    """A fresh draw of cases, whose names and seeds nobody knew before its seed was revealed."""

    name: str
    seed: str
    """The revealed seed, any text."""

    @property
    def policy_seed(self) -> int:
        """Seed of the policy in all cases of the draw, 0 to 99,999."""
        return seed_of(self.name, self.seed, "policy") % 100_000


@dataclass(frozen=True)
class Identity:
    """Configuration of a case, apart from its event."""

    source: str
    """``plus``, ``pro``, or the benchmark of an unmodified task."""
    suite: str
    task_index: int
    """Index in the source's registry."""
    init_state_index: int
    category: str = ""
    """Source category of a LIBERO-PRO task, for example ``view_occlusion``; otherwise empty."""
    draw: Draw | None = None
    """The fresh draw of the case; None for the frozen tracks."""

    @classmethod
    def unmodified(cls, suite: str, task_index: int, init_state_index: int) -> Identity:
        """Return the configuration of a task as its benchmark has it."""
        return cls(SUITES[suite].benchmark, suite, task_index, init_state_index)

    @property
    def sampler(self) -> str:
        return self._named(SAMPLERS.get(self.source, f"libero-max-{self.source}-v1.0"))

    @property
    def policy_seed(self) -> int:
        return POLICY_SEED if self.draw is None else self.draw.policy_seed

    def _named(self, sampler: str) -> str:
        return sampler if self.draw is None else f"{sampler}/{self.draw.name}"

    def _seed_of(self, *parts: object) -> int:
        """Return :func:`seed_of` the parts, of a fresh draw of its seed as well."""
        return seed_of(*parts) if self.draw is None else seed_of(*parts, self.draw.seed)

    @property
    def base_task_id(self) -> str:
        if self.source == "pro":
            return f"libero-pro/{self.category}/{self.suite}/task_{self.task_index}"
        prefix = "" if self.source in VARIED else f"{self.source}/"
        return f"{prefix}{self.suite}/task_{self.task_index}"

    def seed(self, event: str, variant: int) -> int:
        """Scenario seed of an event on this configuration."""
        if self.source == "plus":
            return self._seed_of(self.sampler, self.suite, self.task_index, event, variant)
        where = (self.category,) if self.source == "pro" else ()
        return self._seed_of(
            self.sampler, *where, self.suite, self.task_index, self.init_state_index, event, variant
        )

    def direction_index(self, event: str) -> int:
        """Return the relocation direction, 0 to 7; the same for every variant and initial state."""
        sampler = self._named(DIRECTION_SAMPLER)
        return self._seed_of(sampler, self.suite, self.task_index, event, "direction") % 8

    def scenario_id(self, event: str, variant: int) -> str:
        if self.source == "plus":
            return f"{self.suite}-t{self.task_index:04d}-{event}-d{variant}"
        benchmark = "libero" if self.source in VARIED else self.source
        short = self.suite.removeprefix(f"{benchmark}_")
        prefix = f"pro-{self.category.replace('_', '-')}" if self.source == "pro" else benchmark
        return f"{prefix}-{short}-t{self.task_index:02d}-i{self.init_state_index:02d}-{event}-d{variant}"

    def case_id(self, event: str, variant: int) -> str:
        return f"{self.scenario_id(event, variant)}-p{self.policy_seed}"
