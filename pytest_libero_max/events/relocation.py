"""Common parts of the two relocations: an object is moved along the table, in one of eight directions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
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

LEAST_SHARE = 0.1
"""Least share of a thing's places that a move has to leave in its room."""

_DECIMALS = 8
_STEP_M = 0.06  # the shorter move of both relocations


def relocation(
    event: str, moved: str | None, distance_m: float, task: TaskMetadata, identity: Identity
) -> Json:
    """Return the change that moves an object; its direction depends on the task and the event alone.

    A thing with a room of its own goes where most of its places stay in the room.
    """
    assert moved is not None  # eligibility demands it
    directions = _roomy(moved, task)
    x, y = directions[identity.direction_index(event) % len(directions)]
    return {
        "operation": "move_object",
        "object": moved,
        "delta_position_m": [round(x * distance_m, _DECIMALS), round(y * distance_m, _DECIMALS), 0.0],
        "direction_xy": [round(x, _DECIMALS), round(y, _DECIMALS)],
        "distance_m": distance_m,
        "support_entity": task.support(moved),
        "calibration": "deterministic_candidate_requires_preflight",
    }


def has_room(moved: str | None, farthest_m: float, task: TaskMetadata) -> bool:
    """Return True if a thing can be moved that far: its room is large enough, or it has none of its own."""
    if moved is None or moved not in task.rooms:
        return True
    room = task.rooms[moved]
    return any(room.share(x * farthest_m, y * farthest_m) >= LEAST_SHARE for x, y in DIRECTIONS)


def _roomy(moved: str, task: TaskMetadata) -> Sequence[tuple[float, float]]:
    """Return the directions in which most of a thing's places stay in its room; all where it has none."""
    if moved not in task.rooms:
        return DIRECTIONS
    shares = [round(task.rooms[moved].share(x * _STEP_M, y * _STEP_M), _DECIMALS) for x, y in DIRECTIONS]
    return [way for way, share in zip(DIRECTIONS, shares, strict=True) if share == max(shares)]


def relocations(objects: Iterable[str]) -> SearchStrategy[Scenario]:
    """Scenarios that move one of ``objects`` along the table, for Hypothesis."""
    from hypothesis import strategies as st

    from pytest_libero_max.changes import MoveObject
    from pytest_libero_max.events.change_strategies import vectors

    moves = st.builds(MoveObject, st.sampled_from(sorted(objects)), vectors(0.12, plane=True))
    return moves.map(lambda move: Scenario(move.to_dict()))
