"""Changes that leave the world as it is: the empty one, new seeds for the policy, and late answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

from pytest_libero_max.benchmark.latency import CHANGED_BY, Latency
from pytest_libero_max.benchmark.structs import rule
from pytest_libero_max.changes.change import Evidence, check_evidence
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import ManifestFields, all_or_nothing, strength_of
from pytest_libero_max.worlds.contract import AlterableWorld

_STEPS = rule("steps, for example 4steps or 4steps,sync", pattern=r"^(0|[1-9][0-9]{0,2})steps(,sync)?$(?!\n)")


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
        check_evidence(self.operation, self.factors, evidence)
        return self

    def scaled(self, strength: float) -> Nothing:
        strength_of(self.operation, strength)
        return self


class Indivisible(ManifestFields):
    """A change that has no other magnitude than its own."""

    def scaled(self, strength: float) -> Self | Nothing:
        """Return the change at strength 1, nothing at strength 0; other strengths are errors."""
        return self if all_or_nothing(self.operation, strength) else Nothing()


@dataclass(frozen=True)
class ReseedPolicy(Nothing):
    """Leave the world as it is, and ask the policy with other seeds from the next query on.

    The sham event: what changes after it, changes by the policy's own randomness. The runner sees it among
    the entries that have happened (:meth:`pytest_libero_max.pairing.trajectory.Trajectory.reseeds`).
    """

    operation: ClassVar[str] = "reseed_policy"


@dataclass(frozen=True)
class DelayAnswers(Nothing):
    """Leave the world as it is, and let it go on while the policy is asked, from the next query on.

    The runner sees it among the entries that have happened
    (:meth:`pytest_libero_max.pairing.trajectory.Trajectory.latency_of`).
    """

    operation: ClassVar[str] = CHANGED_BY

    latency: Annotated[str, _STEPS] | None = None
    """Time that a query takes, for example ``4steps`` or ``4steps,sync``; None for that of the arm."""

    def takes(self, usual: Latency) -> Latency:
        """Return the time that a query takes, given that of the arm."""
        return usual if self.latency is None else Latency.parse(self.latency)

    def reverted(self, evidence: Evidence) -> DelayAnswers:
        check_evidence(self.operation, self.factors, evidence)
        return DelayAnswers()

    def scaled(self, strength: float) -> Nothing:
        """Return the change at strength 1, nothing at strength 0; other strengths are errors."""
        return self if all_or_nothing(self.operation, strength) else Nothing()
