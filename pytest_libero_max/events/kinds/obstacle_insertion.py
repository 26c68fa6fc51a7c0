"""obstacle_insertion: an object stands in the way to the target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.insertion import placement, placements, removals
from pytest_libero_max.events.kind import EventKind, Scenario, entity_of

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

OFFSETS_M = ((0.14, 0.0, 0.0), (0.0, -0.14, 0.0))
"""Position of the obstacle relative to the trigger entity, world frame, by variant."""


class ObstacleInsertion(EventKind):
    """One distractor, taken out of the scene at reset, stands 14 cm from the trigger entity."""

    name = "obstacle_insertion"
    family = "path_constraint"
    code = "OBSTACLE"
    severities = ("high", "high")
    response = "replan"
    needs = "an object without a part in the task on the support of its target."
    expected = "Plan another path: an object stands where the hand may pass on its way to the target."

    def eligible(self, task: TaskMetadata) -> bool:
        return bool(task.obstacle_candidates)

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        candidates = task.obstacle_candidates
        chosen = candidates[variant % len(candidates)]
        change = {
            "operation": "insert_obstacle",
            **placement(chosen, entity_of(task), list(OFFSETS_M[variant]), task),
            "placement_rule": "target_support_approach_ring",
        }
        return Scenario(change, removals([chosen], task.parked))

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Any other object anywhere around the trigger entity."""
        from hypothesis import strategies as st

        from pytest_libero_max.changes import InsertObstacle

        others = [name for name, entity in entities.items() if entity.kind == "object" and name != trigger]
        return st.sampled_from(others).flatmap(
            lambda entity: placements(InsertObstacle, entity, trigger).map(
                lambda change: Scenario(change.to_dict(), removals([entity]))
            )
        )
