"""Changes that leave the world as it is: the empty one, and new seeds for the policy."""

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
        check_evidence(self, evidence)
        return self

    def scaled(self, strength: float) -> Nothing:
        strength_of(self.operation, strength)
        return self


@dataclass(frozen=True)
class ReseedPolicy(Nothing):
    """Leave the world as it is, and ask the policy with other seeds from the next query on.

    The sham event: what changes after it, changes by the policy's own randomness. The runner sees it among
    the entries that have happened (:meth:`pytest_libero_max.pairing.trajectory.Trajectory.reseeds`).
    """

    operation: ClassVar[str] = "reseed_policy"
