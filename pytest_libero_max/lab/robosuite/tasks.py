"""Five of robosuite's tasks: what their scenes contain, what their goals are about, what is spare.

The order is that of the task indices of each suite.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, Room, TaskMetadata
from pytest_libero_max.worlds.contract import Entity

Size = tuple[float, float, float]

TABLE_TOP_M = 0.8
"""Height of the tables, m, world."""
BIN_FLOOR_M = 0.82
"""Height of the floor of the bins, m, world."""

SPARES = MappingProxyType(
    {
        "spare_1": ((0.022, 0.022, 0.03), (0.15, 0.35, 0.85, 1.0)),
        "spare_2": ((0.018, 0.026, 0.022), (0.9, 0.75, 0.1, 1.0)),
        "spare_3": ((0.026, 0.018, 0.035), (0.55, 0.2, 0.6, 1.0)),
        "spare_4": ((0.02, 0.02, 0.02), (0.95, 0.5, 0.15, 1.0)),
        "spare_5": ((0.024, 0.02, 0.026), (0.1, 0.65, 0.65, 1.0)),
    }
)
"""Half sizes (3,) in m and colours of the blocks that an event may bring in. Boxes neither roll nor rock."""

_NO_ROOM = "There is no room for other objects on the table that the door stands on."


@dataclass(frozen=True)
class Task:
    """A task of robosuite.

    Attributes:
        name: robosuite's name of its environment.
        language: Instruction; robosuite has none.
        goal: Predicate of its check of success, and what that is about, target first.
        things: What a case can name, without the spares.
        idle: Objects of its sibling tasks, which robosuite throws out of the scene.
        supports_m: Entity that spares stand on, and its height; None where there is no room for them.
        rooms: Places to which an event may move something; anywhere on a table.
    """

    name: str
    language: str
    goal: tuple[str, ...]
    things: tuple[Entity, ...]
    idle: tuple[Entity, ...] = ()
    supports_m: tuple[str, float] | None = None
    rooms: Mapping[str, Room] = field(default_factory=dict)

    @property
    def spares(self) -> tuple[Entity, ...]:
        """The blocks that wait out of the scene."""
        if self.supports_m is None:
            return ()
        return tuple(Entity(name, "block", "object", f"{name}_main", self.supports_m[0]) for name in SPARES)

    @property
    def entities(self) -> dict[str, Entity]:
        """Everything of the compiled scene that has a name, by name."""
        return {entity.name: entity for entity in (*self.things, *self.idle, *self.spares)}

    def spare_place(self, name: str) -> Size:
        """Return where a spare stands before it is taken out, m, world: in a row behind the scene."""
        assert self.supports_m is not None
        (_, _, half), _ = SPARES[name]
        return (-1.5, -0.4 + 0.2 * [*SPARES].index(name), self.supports_m[1] + half)

    @property
    def metadata(self) -> TaskMetadata:
        """Contents of the scene, by which events are chosen."""
        present = (*self.things, *self.spares)
        objects = {entity.name: entity.category for entity in present if entity.kind == "object"}
        predicate, *arguments = self.goal
        return TaskMetadata(
            name=self.name,
            language=self.language,
            objects=objects,
            fixtures={entity.name: entity.category for entity in present if entity.kind != "object"},
            objects_of_interest=frozenset(arguments),
            goal=(Relation(predicate.capitalize(), tuple(arguments)),),
            placements={
                entity.name: InitialPlacement("On", entity.support, entity.support)
                for entity in present
                if entity.support is not None
            },
            parked=frozenset(entity.name for entity in self.spares),
            rooms=self.rooms,
            impossible={}
            if self.spares
            else dict.fromkeys(("distractor_burst", "obstacle_insertion"), _NO_ROOM),
        )


def _object(name: str, category: str, support: str | None = "table") -> Entity:
    return Entity(name, category, "object", f"{name}_main", support)


_TABLE = Entity("table", "table", "surface", "table")

TASKS = (
    Task(
        "Lift",
        "lift the red cube",
        ("lifted", "cube"),
        (_object("cube", "cube"), _TABLE),
        supports_m=("table", TABLE_TOP_M),
    ),
    Task(
        "Stack",
        "put the red cube on the green cube",
        ("on", "cubeA", "cubeB"),
        (_object("cubeA", "cube"), _object("cubeB", "cube"), _TABLE),
        supports_m=("table", TABLE_TOP_M),
    ),
    Task(
        "PickPlaceCan",
        "put the can into the bin with the picture of a can",
        ("in", "Can", "bin2"),
        (
            _object("Can", "can", "bin1"),
            Entity("bin1", "bin_table", "surface", "bin1"),  # a table with a rim
            Entity("bin2", "bin", "fixture", "bin2"),
        ),
        idle=tuple(_object(name, name.lower(), None) for name in ("Milk", "Bread", "Cereal")),
        supports_m=("bin1", BIN_FLOOR_M),
        rooms={"Can": Room((-0.01, -0.41), (0.21, -0.09))},  # where robosuite puts it
    ),
    Task(
        "NutAssemblySquare",
        "put the square nut onto the square peg",
        ("on", "SquareNut", "peg1"),
        (
            _object("SquareNut", "nut"),
            Entity("peg1", "peg", "fixture", "peg1"),
            Entity("peg2", "peg", "fixture", "peg2"),
            _TABLE,
        ),
        idle=(_object("RoundNut", "nut", None),),
        supports_m=("table", 0.82),
    ),
    Task(
        "Door",
        "open the door",
        ("open", "Door"),
        (Entity("Door", "door", "fixture", "Door_main", "table"), _TABLE),
    ),
)


def task_of(index: int) -> Task:
    """Return a task by its index.

    Raises:
        SubstrateError: There is none.
    """
    if not 0 <= index < len(TASKS):
        raise SubstrateError.seen(
            "task_index", index, f", but the suites of robosuite have the tasks 0 to {len(TASKS) - 1}."
        )
    return TASKS[index]
