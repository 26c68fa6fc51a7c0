"""Common parts of changes: measured before and after, taken back, and divided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

from pytest_libero_max.changes.change import Evidence
from pytest_libero_max.changes.factors import Factor, altered, read
from pytest_libero_max.changes.fields import ManifestFields, strength_of
from pytest_libero_max.changes.reversal import Reversal
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld


class Alteration(ManifestFields):
    """A change that leaves evidence of what it alters, and can be taken back by it."""

    touched: ClassVar[frozenset[Factor]] = frozenset()
    """Its factors, where they are the same for all values of its fields."""
    final: ClassVar[str] = ""
    """Reason why it cannot be taken back, as a sentence; empty where it can."""
    magnitudes: ClassVar[tuple[str, ...]] = ()
    """Fields that a strength multiplies: numbers, tuples of them, or None."""

    @property
    def factors(self) -> frozenset[Factor]:
        return self.touched

    def apply(self, world: AlterableWorld) -> Evidence:
        self._require(world)
        before, former = self._measure(world), read(world, self._in_order())
        self._alter(world)
        after = self._measure(world)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, after, altered(world, former))

    def scaled(self, strength: float) -> Any:
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else self._at(s)

    def reverted(self, evidence: Evidence) -> Reversal:
        """Return the reversal, which writes the former values of the factors again, or raise ChangeError."""
        if self.final:
            raise ChangeError(f"{self.operation} cannot be taken back: {self.final} Leave it out.")
        return Reversal.of(self.operation, self.factors, evidence)

    def _at(self, strength: float) -> Self:
        """Return the change at a strength below 1."""
        scaled = {name: _times(getattr(self, name), strength) for name in self.magnitudes}
        return replace(self, **scaled)  # type: ignore[type-var]

    def _in_order(self) -> Sequence[Factor]:
        """Return its factors in the order in which they are taken back."""
        return sorted(self.factors)

    def _require(self, world: AlterableWorld) -> None:
        """Refuse a world in which the change cannot happen, before anything is measured or altered."""

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        """Return what the change may alter, as plain JSON values."""
        raise NotImplementedError

    def _alter(self, world: AlterableWorld) -> None:
        """Alter the world."""
        raise NotImplementedError


class Blended(Alteration):
    """A change of which a share can happen; its last field is ``blend``."""

    blend: float | None

    @property
    def share(self) -> float:
        """Share that happens, 0 to 1."""
        return 1.0 if self.blend is None else self.blend

    def _at(self, strength: float) -> Self:
        return replace(self, blend=self.share * strength)  # type: ignore[type-var]


def _times(value: Any, strength: float) -> Any:
    if isinstance(value, tuple):
        return tuple(part * strength for part in value)
    return None if value is None else value * strength
