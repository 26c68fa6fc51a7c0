"""Common parts of the insertions: objects leave the scene at reset and return beside the trigger entity.

What the scene itself keeps out at reset (:attr:`.TaskMetadata.parked`) needs no removal.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.documents import Json

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.tasks.contents import TaskMetadata


def placement(entity: str, anchor: str, offset_m: list[float], task: TaskMetadata) -> Json:
    """Return the place at which an object returns: an offset from the anchor, at the height it had."""
    return {
        "object": entity,
        "relative_to": anchor,
        "offset_m": offset_m,
        "preserve_initial_z": True,
        "support_entity": task.support(entity),
    }


def removals(entities: Iterable[str], parked: Container[str] = ()) -> tuple[Json, ...]:
    """Return the setup that takes objects out of the scene until the event brings them back.

    Args:
        parked: Objects that are out of it already.
    """
    return tuple(
        {
            "operation": "remove_object",
            "object": entity,
            "offworld_position_m": [-2.0 - 0.2 * index, 0.0, -5.0],
        }
        for index, entity in enumerate(entities)
        if entity not in parked
    )


def placements(kind: type[Any], entity: str, anchor: str) -> SearchStrategy[Any]:
    """Return changes or placements of ``kind`` that put ``entity`` near ``anchor``, for Hypothesis."""
    from hypothesis import strategies as st

    from pytest_libero_max.events.change_strategies import vectors

    return st.builds(
        kind,
        object=st.just(entity),
        relative_to=st.just(anchor),
        offset_m=vectors(0.17, plane=True),
        preserve_initial_z=st.booleans(),
    )
