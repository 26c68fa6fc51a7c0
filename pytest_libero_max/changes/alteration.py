"""Common parts of this package's changes: measured before and after, taken back, and divided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import ManifestFields, strength_of
from pytest_libero_max.changes.reversal import Reversal
from pytest_libero_max.worlds.contract import AlterableWorld


class Alteration(ManifestFields):
    """A change that leaves evidence of what it alters, and can be taken back by it."""

    touched: ClassVar[frozenset[Factor]] = frozenset()
    """Its factors, where they are the same for all values of its fields."""

    @property
    def factors(self) -> frozenset[Factor]:
        return self.touched

    def apply(self, world: AlterableWorld) -> Evidence:
        self._require(world)
        before = self._measure(world)
        saved = self._alter(world)
        return Evidence(
            self.operation, tuple(sorted(self.factors)), before, self._measure(world), saved or {}
        )

    def reverted(self, evidence: Evidence) -> Reversal:
        check_evidence(self.operation, self.factors, evidence)
        return Reversal(self.operation, self.factors, **self._former(evidence))

    def _require(self, world: AlterableWorld) -> None:
        """Refuse a world in which the change cannot happen, before anything is measured or altered."""

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        """Return what the change may alter, as plain JSON values."""
        raise NotImplementedError

    def _alter(self, world: AlterableWorld) -> Mapping[str, Any] | None:
        """Alter the world; return the values that only a reversal needs."""
        raise NotImplementedError

    def _former(self, evidence: Evidence) -> dict[str, Any]:
        """Return the fields of the reversal."""
        raise NotImplementedError


class Blended(Alteration):
    """A change of which a share can happen; its last field is ``blend``."""

    blend: float | None

    @property
    def share(self) -> float:
        """Share that happens, 0 to 1."""
        return 1.0 if self.blend is None else self.blend

    def scaled(self, strength: float) -> Self:
        """Return the change with its share multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else replace(self, blend=self.share * s)  # type: ignore[type-var]
