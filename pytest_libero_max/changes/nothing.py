"""The empty change: what a change that cannot be scaled is at strength 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import ManifestFields, strength_of
from pytest_libero_max.worlds.contract import AlterableWorld


@dataclass(frozen=True)
class Nothing(ManifestFields):
    """Leave the world as it is."""

    operation: ClassVar[str] = "nothing"

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset()

    def apply(self, world: AlterableWorld) -> Evidence:
        return Evidence(self.operation, (), {}, {})

    def reverted(self, evidence: Evidence) -> Nothing:
        """Nothing, again."""
        check_evidence(self, evidence)
        return self

    def scaled(self, strength: float) -> Nothing:
        strength_of(self.operation, strength)
        return self
