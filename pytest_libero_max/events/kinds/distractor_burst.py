"""distractor_burst: five objects that have nothing to do with the task appear around the target."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.insertion import placement, placements, removals
from pytest_libero_max.events.kind import EventKind, Scenario, entity_of

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

COUNT = 5
RADIUS_M = (0.09, 0.17)
"""Least and largest distance from the trigger entity."""

_DECIMALS = 8


class DistractorBurst(EventKind):
    """Five distractors, taken out of the scene at reset, stand in a ring around the trigger entity.

    The variants differ by their random draws: which five, at which angles and distances.
    """

    name = "distractor_burst"
    family = "appearance_and_clutter"
    code = "CLUTTER"
    severities = ("high", "high")
    response = "continue"
    needs = f"{COUNT} objects without a part in the task, each on a declared support."
    expected = "Go on with the same plan, past the objects that have appeared around the target."

    def eligible(self, task: TaskMetadata) -> bool:
        return task.trigger_entity is not None and len(task.supported_distractors) >= COUNT

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        draw = random.Random(identity.seed(self.name, variant))
        candidates = list(task.supported_distractors)
        draw.shuffle(candidates)
        chosen = candidates[:COUNT]
        phase = draw.uniform(0.0, 2.0 * math.pi)
        ring = []
        for i, entity in enumerate(chosen):
            angle = phase + i * 2.0 * math.pi / COUNT
            radius = draw.uniform(*RADIUS_M)
            offset = [radius * math.cos(angle), radius * math.sin(angle), 0.0]
            anchor = entity_of(task)
            ring.append(placement(entity, anchor, [round(v, _DECIMALS) for v in offset], task))
        change = {"operation": "insert_distractors", "distractor_count": COUNT, "placements": ring}
        return Scenario(change, removals(chosen, task.parked))

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """One to five objects anywhere around the trigger entity."""
        from hypothesis import strategies as st

        from pytest_libero_max.changes import InsertDistractors, Placement

        others = [name for name, entity in entities.items() if entity.kind == "object" and name != trigger]

        def burst(chosen: list[str]) -> SearchStrategy[Scenario]:
            ring = st.tuples(*(placements(Placement, entity, trigger) for entity in chosen))
            return ring.map(
                lambda placed: Scenario(InsertDistractors(placed, len(placed)).to_dict(), removals(chosen))
            )

        return st.lists(st.sampled_from(others), min_size=1, max_size=COUNT, unique=True).flatmap(burst)
