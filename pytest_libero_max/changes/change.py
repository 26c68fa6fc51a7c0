"""The contract of a change: it alters the factors that it declares, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

from pytest_libero_max.changes.factors import Factor, Former
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld


@dataclass(frozen=True)
class Evidence:
    """Evidence of a change: the values before and after it, as plain JSON values."""

    operation: str
    """Name of the change's operation."""
    factors: tuple[Factor, ...]
    """Factors that it was allowed to touch, sorted."""
    before: Mapping[str, Any]
    """Measured values just before, by name with unit suffix."""
    after: Mapping[str, Any]
    """The same names, just after."""
    altered: tuple[Former, ...] | None = field(default=None, repr=False, compare=False)
    """Factors that it has altered, with their former values, for a reversal. No record holds it."""

    def to_dict(self) -> dict[str, Any]:
        return {
            "operation": self.operation,
            "factors": list(self.factors),
            "before": dict(self.before),
            "after": dict(self.after),
        }


@runtime_checkable
class Change(Protocol):
    """A frozen value that alters a world when it is applied. When that happens is up to the caller."""

    operation: ClassVar[str]
    """The name manifests use."""

    @property
    def factors(self) -> frozenset[Factor]:
        """Everything :meth:`apply` may touch. All else stays bit-identical."""

    def apply(self, world: AlterableWorld) -> Evidence:
        """Alter the world now.

        Raises:
            ChangeError: The world lacks a requirement of the change.
            EntityError: It names an entity the world does not have.
        """

    def scaled(self, strength: float) -> Change:
        """Return the change at another magnitude: ``scaled(0)`` alters nothing, ``scaled(1)`` is the change.

        Raises:
            ChangeError: ``strength`` is not within 0 to 1, or the change cannot be divided.
        """

    def reverted(self, evidence: Evidence) -> Change:
        """Return the change that takes this one back: its factors get their former values, bit for bit.

        Objects come to rest where they were before the change; changes of anything else since then stay.

        Raises:
            ChangeError: The evidence is of another change, or the change cannot be taken back; says why.
        """

    def to_dict(self) -> dict[str, Any]:
        """Return the change as a manifest spells it, ``operation`` included."""


def check_evidence(operation: str, factors: frozenset[Factor], evidence: Evidence) -> None:
    """Check that evidence is of a change with this operation and these factors.

    Raises:
        ChangeError: It is of another one, or was read from a record.
    """
    names = tuple(sorted(factors))
    if (evidence.operation, evidence.factors) != (operation, names):
        raise ChangeError(
            f"evidence of {evidence.operation!r} on {list(evidence.factors)}, but {operation!r} on "
            f"{list(names)} is to be taken back. Give the evidence that its own apply returned."
        )
