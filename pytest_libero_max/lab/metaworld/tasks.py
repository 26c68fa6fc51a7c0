"""The fifty tasks as a table, and what decides which events they can host. No simulator is involved."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.events.kinds.receptacle_relocation import DISTANCES_M as _RECEPTACLE_M
from pytest_libero_max.events.kinds.target_relocation import DISTANCES_M as _TARGET_M
from pytest_libero_max.events.relocation import has_room
from pytest_libero_max.lab.metaworld.robot import HAND_CAMERA, MAIN_CAMERA, MT50
from pytest_libero_max.lab.metaworld.spares import SPARES
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, Room, TaskMetadata

TABLE = "table"
NEAR_M = 0.12
"""Distance from the fingers to the target at which events happen, unless the episode begins nearer."""

_HIGHER_TABLES = ("pick-out-of-hole-v3",)


@dataclass(frozen=True)
class Thing:
    """Something of a task's scene that an event can name."""

    name: str
    body: str = ""
    """Its root body in the model; empty for a mark."""
    site: str = ""
    """Its site in the model, for a mark."""
    free: bool = False
    """True if it has a free joint."""
    room: tuple[float, float, float, float] | None = None
    """Smallest x and y, largest x and y of the places that the task draws for it, m; None without any."""
    fields: tuple[str, ...] = ()
    """Positions that the environment keeps and that come along when it is moved."""
    marks: tuple[str, ...] = ()
    """Sites of the scene that come along."""
    stands_in: str = ""
    """The thing that it is stuck in at the start."""


@dataclass(frozen=True)
class Part:
    """The piece of the target that the hand has to come near."""

    name: str
    body: str
    """The body that belongs to it; empty where it has none of its own."""


@dataclass(frozen=True)
class Task:
    """One of the fifty tasks."""

    name: str
    """Meta-World's name, for example ``push-v3``."""
    instruction: str
    target: str
    """Name of the thing that the hand works on."""
    receptacle: str | None
    """Name of the thing where the target has to go."""
    part: Part | None
    things: Mapping[str, Thing]
    near_m: float = NEAR_M
    """Distance from the fingers to the target or its part at which events happen."""


@cache
def all_tasks() -> tuple[Task, ...]:
    """Return the tasks by their index."""
    rows = tomllib.loads(read_text(Path(__file__).with_name("tasks.toml")))["task"]
    return tuple(map(_task, rows))


def _task(row: Mapping[str, Any]) -> Task:
    things = {name: Thing(name, **_frozen(values)) for name, values in row["things"].items()}
    part = Part(**row["part"]) if "part" in row else None
    near_m = row.get("near_m", NEAR_M)
    return Task(row["name"], row["instruction"], row["target"], row.get("receptacle"), part, things, near_m)


def _frozen(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


def task(index: int) -> Task:
    """Return a task.

    Raises:
        SubstrateError: There is no such index.
    """
    if not 0 <= index < MT50.tasks:
        raise SubstrateError.seen("task_index", index, f", but Meta-World has tasks 0 to {MT50.tasks - 1}.")
    return all_tasks()[index]


def contents(suite: str, index: int) -> TaskMetadata:
    """Return what construction decides by."""
    row = task(index)
    movable = {name: name for name in (row.target, row.receptacle) if name is not None}
    spares = {spare.name: spare.name for spare in SPARES}
    on_table = InitialPlacement("On", TABLE, TABLE)
    metadata = TaskMetadata(
        name=row.name,
        language=row.instruction,
        objects={**movable, **spares},
        fixtures={TABLE: TABLE, **{name: name for name in row.things if name not in movable}},
        objects_of_interest=frozenset(movable),
        goal=(Relation("Done", tuple(movable)),),
        placements=dict.fromkeys((*movable, *spares), on_table),
        camera=MAIN_CAMERA,
        other_cameras=(HAND_CAMERA,),
        part=None if row.part is None else row.part.name,
        trigger_distance_m=row.near_m,
        rooms={thing.name: _room(thing.room) for thing in row.things.values() if thing.room is not None},
    )
    return replace(metadata, impossible=_impossible(row, metadata))


def _room(corners: tuple[float, float, float, float]) -> Room:
    return Room(corners[:2], corners[2:])


def _impossible(row: Task, metadata: TaskMetadata) -> dict[str, str]:
    moves = {
        "target_relocation": (row.target, _TARGET_M[-1]),
        "receptacle_relocation": (row.receptacle, _RECEPTACLE_M[-1]),
    }
    reasons = {event: _fixed(row, name, way, metadata) for event, (name, way) in moves.items()}
    if row.name in _HIGHER_TABLES:
        higher = "its table is higher than the one on which the spare objects stand."
        reasons |= {"distractor_burst": higher, "obstacle_insertion": higher}
    return {event: reason for event, reason in reasons.items() if reason}


def _fixed(row: Task, name: str | None, farthest_m: float, metadata: TaskMetadata) -> str:
    """Return the reason why a thing cannot be moved that far; empty where it can."""
    if name is None:
        return "its goal is a state of the target, and no thing that could be elsewhere."
    thing = row.things[name]
    if thing.stands_in:
        return f"its target begins stuck in the {thing.stands_in}, which cannot come along."
    if thing.room is None:
        return f"it never draws another place for its {name}."
    if not has_room(name, farthest_m, metadata):
        width, depth = thing.room[2] - thing.room[0], thing.room[3] - thing.room[1]
        if width == depth == 0.0:
            return f"it always puts its {name} at the same place."
        return (
            f"it draws the place of the thing from {100 * width:.0f} x {100 * depth:.0f} cm, too little "
            f"for a move by {100 * farthest_m:.0f} cm."
        )
    return ""
