"""Reversal of a change: the values that it overwrote, written again."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.changes.change import Evidence, check_evidence
from pytest_libero_max.changes.factors import Factor, Former, filter_records, measure_poses
from pytest_libero_max.changes.fields import all_or_nothing
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld

if TYPE_CHECKING:
    from pytest_libero_max.changes.change import Change


@dataclass(frozen=True)
class Reversal:
    """Reversal of a change: writes the values again that were there before the change.

    A change's ``reverted`` makes it from the evidence of ``apply``; it belongs to the scene in which the
    change was applied. Objects come back to exactly where they were before the change, at rest, wherever they
    have been moved since. Motion that the change caused stays. Velocities, and the order in which objects
    were taken out of the scene, are not restored.
    """

    operation: ClassVar[str] = "revert"

    reverts: str
    """Operation of the change that is taken back."""
    factors: frozenset[Factor]
    """Factors that it may touch: those of that change."""
    altered: tuple[Former, ...] = field(default=(), repr=False, compare=False)
    """Factors that the change has altered, with their former values."""

    @classmethod
    def of(cls, operation: str, factors: frozenset[Factor], evidence: Evidence) -> Reversal:
        """Return the reversal of a change with this operation and these factors, or raise ChangeError."""
        check_evidence(operation, factors, evidence)
        if evidence.altered is None:
            raise ChangeError(
                f"{operation} cannot be taken back from a record: only the evidence that apply returned "
                "holds the former values. Play the case again."
            )
        return cls(operation, factors, evidence.altered)

    def apply(self, world: AlterableWorld) -> Evidence:
        """Write the former values, or raise ChangeError."""
        for former in self.altered:
            if former.kind == "pose" and former.before.taken_out_of and former.name in world.parked:
                raise ChangeError(f"revert of {self.reverts}: {former.name!r} is out of the scene already.")
        before = self._measure(world)
        for former in self.altered:
            former.write_back(world)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, self._measure(world))

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        kinds = {former.kind for former in self.altered}
        measured: dict[str, Any] = {}
        if "pose" in kinds:
            measured |= measure_poses(world, [part.name for part in self.altered if part.kind == "pose"])
        if "pixels" in kinds:
            measured["filters"] = filter_records(world)
        if "robot" in kinds:
            measured["joint_pos_rad"] = world.arm_joints().tolist()
        if kinds & {"instruction", "goal"}:
            measured["instruction"] = world.language
        return measured

    def scaled(self, strength: float) -> Change:
        """Return the reversal at strength 1, nothing at strength 0; other strengths are errors."""
        return self if all_or_nothing(self.operation, strength) else Nothing()

    def reverted(self, evidence: Evidence) -> Change:
        """Refuse with ChangeError: a reversal is not taken back."""
        raise ChangeError(f"revert of {self.reverts} cannot be taken back. Apply {self.reverts} anew.")

    def to_dict(self) -> dict[str, Any]:
        """Return the reversal as JSON values, for people: a manifest cannot hold it."""
        return {"operation": self.operation, "reverts": self.reverts, "factors": sorted(self.factors)}
