"""target_relocation: the object to grasp is somewhere else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.kind import EventKind, Scenario
from pytest_libero_max.events.relocation import has_room, relocation, relocations

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

DISTANCES_M = (0.06, 0.12)
"""Distance of the move along the table, by variant."""


class TargetRelocation(EventKind):
    """The target is moved along its support, in a direction that is fixed for the task."""

    name = "target_relocation"
    family = "geometry"
    code = "GEO"
    severities = ("medium", "high")
    response = "replan"
    needs = "a movable target that was put on a table or floor."
    expected = "Plan again: the object to grasp is 6 or 12 cm from where it was."

    def eligible(self, task: TaskMetadata) -> bool:
        moved = task.primary_target
        return task.planar(moved) and has_room(moved, DISTANCES_M[-1], task)

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        return Scenario(relocation(self.name, task.primary_target, DISTANCES_M[variant], task, identity))

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Return moves of the trigger entity, which is the target."""
        return relocations([trigger])
