"""Common parts of the two relocations: an object is moved along the table, in one of eight directions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.kind import Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata

_DIAGONAL = 1.0 / math.sqrt(2.0)
DIRECTIONS = (
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (_DIAGONAL, _DIAGONAL),
    (-_DIAGONAL, _DIAGONAL),
    (_DIAGONAL, -_DIAGONAL),
    (-_DIAGONAL, -_DIAGONAL),
)
"""Unit vectors in the table plane along which a relocation may go, world frame."""

_DECIMALS = 8


def relocation(
    event: str, moved: str | None, distance_m: float, task: TaskMetadata, identity: Identity
) -> Json:
    """Return the change that moves an object; its direction depends on the task and the event alone."""
    assert moved is not None  # eligibility demands it
    x, y = DIRECTIONS[identity.direction_index(event)]
    return {
        "operation": "move_object",
        "object": moved,
        "delta_position_m": [round(x * distance_m, _DECIMALS), round(y * distance_m, _DECIMALS), 0.0],
        "direction_xy": [round(x, _DECIMALS), round(y, _DECIMALS)],
        "distance_m": distance_m,
        "support_entity": task.support(moved),
        "calibration": "deterministic_candidate_requires_preflight",
    }


def relocations(objects: Iterable[str]) -> SearchStrategy[Scenario]:
    """Scenarios that move one of ``objects`` along the table, for Hypothesis."""
    from hypothesis import strategies as st

    from pytest_libero_max.changes import MoveObject
    from pytest_libero_max.events.change_strategies import vectors

    moves = st.builds(MoveObject, st.sampled_from(sorted(objects)), vectors(0.12, plane=True))
    return moves.map(lambda move: Scenario(move.to_dict()))
