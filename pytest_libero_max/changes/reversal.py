"""Reversal of a change: the values that it overwrote, written again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.changes.change import Evidence, Factor
from pytest_libero_max.changes.fields import all_or_nothing
from pytest_libero_max.changes.measuring import filter_records, measure_poses
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, Goal
from pytest_libero_max.worlds.robot import ROBOT

if TYPE_CHECKING:
    from pytest_libero_max.changes.change import Change

Row = tuple[str, "str | int | None", Any]
"""Model field, its row (a camera's name, a number, None: the whole field), values."""

Pose = tuple[str, tuple[float, ...]]
"""Entity, position (m) and orientation (wxyz), seven numbers."""


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
    rows: tuple[Row, ...] = ()
    """Model fields to write."""
    filters: tuple[Mapping[str, Any], ...] = field(default=(), hash=False)
    """Pixel filters to remove, as :func:`~.measuring.filter_records` describes them."""
    placed: tuple[Pose, ...] = ()
    """Entities to place, or to bring back where they have been taken out."""
    parked: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...] = ()
    """Objects to take out of the scene again: where each was kept, and the pose it had in the scene."""
    joints: tuple[float, ...] | None = None
    """Joint positions of the arm (7,), rad; None leaves it alone."""
    assigned: tuple[()] | tuple[str | None, Goal | None] = ()
    """Instruction and goal to assign, None where the task's own are to hold; an empty tuple leaves both
    alone."""

    def apply(self, world: AlterableWorld) -> Evidence:
        """Write the former values.

        Raises:
            ChangeError: A filter to remove is not there, or an object to take out has been taken out already.
        """
        entities = [name for name, _ in self.placed] + [name for name, *_ in self.parked]

        def measure() -> dict[str, Any]:
            measured: dict[str, Any] = {}
            if entities:
                measured |= measure_poses(world, entities)
            if self.filters:
                measured["filters"] = filter_records(world)
            if self.joints is not None:
                measured["joint_pos_rad"] = world.observe(cameras=())[f"{ROBOT}_joint_pos"].tolist()
            if self.assigned:
                measured["instruction"] = world.language
            return measured

        for name, *_ in self.parked:
            if name in world.parked:
                raise ChangeError(f"revert of {self.reverts}: {name!r} is out of the scene already.")
        before = measure()
        for record in self.filters:
            matches = [number for number, known in enumerate(filter_records(world)) if known == record]
            if not matches:
                raise ChangeError(
                    f"revert of {self.reverts}: the filter {dict(record)!r} is not active any more. "
                    "Take a change back once."
                )
            world.remove_filter(matches[-1])
        for field_name, row, values in self.rows:
            number = world.model.camera(row).id if isinstance(row, str) else row
            world.alter(field_name, slice(None) if number is None else number, values)
        for name, pose in self.placed:
            put = world.unpark if name in world.parked else world.place
            put(name, pose[:3], pose[3:])
        for name, kept_at, pose in self.parked:
            world.place(name, pose[:3], pose[3:])
            world.park(name, kept_at)
        if self.joints is not None:
            world.pose_arm(self.joints)
        if self.assigned:
            world.reassign(self.assigned)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, measure())

    def scaled(self, strength: float) -> Change:
        """Return the reversal at strength 1, nothing at strength 0; other strengths are errors."""
        return self if all_or_nothing(self.operation, strength) else Nothing()

    def reverted(self, evidence: Evidence) -> Change:
        """Refuse: a reversal is not taken back.

        Raises:
            ChangeError: Always.
        """
        raise ChangeError(f"revert of {self.reverts} cannot be taken back. Apply {self.reverts} anew.")

    def to_dict(self) -> dict[str, Any]:
        """Return the reversal as JSON values, for people: a manifest cannot hold it."""
        return {"operation": self.operation, "reverts": self.reverts, "factors": sorted(self.factors)}


def saved(evidence: Evidence, name: str) -> Any:
    """Return a value that ``apply`` kept for the reversal.

    Raises:
        ChangeError: The evidence was read from a record, which does not hold it.
    """
    if name not in evidence.saved:
        raise ChangeError(
            f"{evidence.operation} cannot be taken back from a record: it needs {name!r}, which only the "
            "evidence that apply returned holds. Play the case again."
        )
    return evidence.saved[name]


def altered_rows(evidence: Evidence, fields: Mapping[str, str], camera: str | None = None) -> tuple[Row, ...]:
    """Return the former values of the model fields that a change has altered.

    Args:
        fields: Model fields by the names under which the evidence has them.
        camera: The camera whose rows they are; None: the evidence has whole fields.
    """
    before, after = evidence.before, evidence.after
    return tuple(
        (name, camera, frozen(before[key])) for key, name in fields.items() if before[key] != after[key]
    )


def frozen(value: Any) -> Any:
    """Return lists as tuples, all the way down."""
    return tuple(frozen(item) for item in value) if isinstance(value, list | tuple) else value


def added_filters(evidence: Evidence) -> tuple[Mapping[str, Any], ...]:
    """Return the records of the filters that a change has added."""
    return tuple(evidence.after["filters"][len(evidence.before["filters"]) :])


def former_poses(evidence: Evidence, names: Sequence[str]) -> tuple[Pose, ...]:
    """Return the poses of entities before a change."""
    before = evidence.before
    return tuple((name, (*before["position_m"][name], *before["quaternion_wxyz"][name])) for name in names)
