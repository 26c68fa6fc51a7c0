"""Which events a task can host. Decided from its description alone."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import EVENTS
from pytest_libero_max.sources.metadata import TaskMetadata

DISTRACTOR_COUNT = 5
"""Objects a distractor burst brings in."""


def eligible(event: str, task: TaskMetadata) -> bool:
    """Whether ``task`` has what ``event`` needs.

    The image-space events need something to trigger on; a relocation needs a movable target (or
    receptacle) that was put on a table or floor; a burst needs five distractors with declared supports; an
    obstacle needs a distractor on the support of the trigger entity.
    """
    if event == "target_relocation":
        return task.planar(task.primary_target)
    if event == "receptacle_relocation":
        return task.planar(task.primary_receptacle)
    if event == "distractor_burst":
        return task.trigger_entity is not None and len(task.supported_distractors) >= DISTRACTOR_COUNT
    if event == "obstacle_insertion":
        return bool(task.obstacle_candidates)
    return task.trigger_entity is not None


def eligible_events(task: TaskMetadata) -> tuple[str, ...]:
    """The events ``task`` can host, in the benchmark's order."""
    return tuple(event for event in EVENTS if eligible(event, task))
