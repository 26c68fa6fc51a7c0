"""Triggers: frozen values that are asked after every step whether an entry of a schedule happens.

A new trigger is one class here, or in another package that offers it under its type in the entry-point group
``pytest_libero_max.triggers``: its fields are its parameters, ``fires`` is its rule, and its manifest form
follows from both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pytest_libero_max.benchmark.cases import PROXIMITY, TRIGGER_DISTANCE_M
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import (
    Length,
    Object,
    Positive,
    checked,
    require_fields,
    rule,
    struct_of,
)
from pytest_libero_max.errors import ManifestError, did_you_mean
from pytest_libero_max.registry import Registry, given
from pytest_libero_max.worlds.robot import GRIPPER, ROBOT

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import Array, World

ABOVE_RADIUS_M = 0.08

_Entity = Annotated[str, rule("the name of an entity", min_length=1)]
_Earlier = Annotated[int, rule("the index of an earlier entry, or -1 for the one just before", ge=-1)]
_Fraction = Annotated[
    float, rule("a number between 0 and 1. Use 'at_start' for the start of the episode", gt=0, lt=1)
]


def distance_m(first: Array, second: Array) -> float:
    """Euclidean distance of two points (3,) in m: the only definition by which proximity is decided.

    It is spelled out because a BLAS norm may round differently from one processor to the next.
    """
    x, y, z = (first - second).tolist()
    return math.sqrt(x * x + y * y + z * z)


@dataclass(frozen=True)
class Moment:
    """An episode between two steps, as a trigger sees it."""

    step: int
    """Policy steps executed; 0 before the policy begins."""
    budget: int
    """Policy steps that the episode may take."""
    world: World
    """The world as it is now. A trigger reads it and alters nothing."""
    fired: tuple[int, ...] = ()
    """For each earlier entry of the schedule, the step at which it fired."""


@dataclass(frozen=True)
class Trigger:
    """Decides at which moment an entry of a schedule happens.

    It is asked once before the policy begins and then after every step, as long as the episode is running.
    The entry happens at the first moment at which the answer is yes. The answer depends on the moment alone.
    """

    type: ClassVar[str]
    """The name manifests use."""

    spelling: ClassVar[Mapping[str, str]] = {}
    """Manifest names of the fields that are called differently there."""

    def __post_init__(self) -> None:
        checked(self._values(), struct_of(type(self)), self.type, ManifestError)

    def fires(self, moment: Moment) -> bool:
        """Return True if the entry happens now.

        Raises:
            EntityError: The world does not have an entity that the trigger names.
        """
        raise NotImplementedError

    def to_dict(self) -> Json:
        """Return the trigger as a manifest spells it."""
        return {"type": self.type, **self._values()}

    def _values(self) -> Json:
        return {self.spelling.get(item.name, item.name): getattr(self, item.name) for item in fields(self)}


def trigger_from_dict(raw: Any, where: str = "trigger") -> Trigger:
    """Read what :meth:`Trigger.to_dict` wrote, or raise ManifestError.

    Args:
        raw: ``type`` and the trigger's parameters.
    """
    values: Json = checked(raw, Object, where, ManifestError)
    name = values.get("type")
    if not isinstance(name, str) or name not in TRIGGERS:
        raise ManifestError.seen(
            f"{where}.type", name, f" is not a trigger. {did_you_mean(str(name), TRIGGERS)}"
        )
    kind = TRIGGERS[name]
    given = {key: value for key, value in values.items() if key != "type"}
    require_fields(given, struct_of(kind), where, ManifestError)
    names = {kind.spelling.get(item.name, item.name): item.name for item in fields(kind)}
    try:
        return kind(**{names[key]: value for key, value in given.items()})
    except ManifestError as error:
        raise error.within(where) from error


@dataclass(frozen=True)
class Proximity(Trigger):
    """The first step that leaves the end effector within a distance of an entity."""

    type = PROXIMITY
    spelling: ClassVar[Mapping[str, str]] = {"entity": "value"}

    entity: _Entity
    """Its name; an object's position is that of its free joint, a fixture's that of its root body."""
    distance_m: Length = TRIGGER_DISTANCE_M
    """In m, above 0."""

    def fires(self, moment: Moment) -> bool:
        return moment.step > 0 and self.reached(moment.world)

    def reached(self, world: World) -> bool:
        """Return True if the end effector is within the distance now."""
        return distance_m(world.end_effector(), world.position(self.entity)) <= self.distance_m


@dataclass(frozen=True)
class AtStart(Trigger):
    """Before the first step: after the settle steps, before the policy's episode begins."""

    type = "at_start"

    def fires(self, moment: Moment) -> bool:
        return moment.step == 0


@dataclass(frozen=True)
class StepsAfter(Trigger):
    """A number of steps after an earlier entry of the schedule."""

    type = "steps_after"

    steps: Positive
    """Policy steps, at least 1."""
    entry: _Earlier = -1
    """Index of the entry, from 0, or -1 for the one just before."""

    def fires(self, moment: Moment) -> bool:
        return moment.step >= moment.fired[self.entry] + self.steps


@dataclass(frozen=True)
class Untouched(StepsAfter):
    """The first step, a number of steps after an earlier entry, that leaves an entity untouched by the robot.

    Attributes:
        entity: Its name.
        steps: Policy steps, at least 1.
        entry: Index of the entry, from 0, or -1 for the one just before.
    """

    type = "untouched"
    spelling: ClassVar[Mapping[str, str]] = {"entity": "value"}

    entity: _Entity = field(kw_only=True)

    def fires(self, moment: Moment) -> bool:
        return super().fires(moment) and not {ROBOT, GRIPPER} & {*moment.world.contacts(self.entity)}


@dataclass(frozen=True)
class AfterGrasp(Trigger):
    """The first step that leaves an object lifted: both fingers touch it, and its support does not."""

    type = "after_grasp"
    spelling: ClassVar[Mapping[str, str]] = {"entity": "value"}

    entity: _Entity
    """Name of the object."""

    def fires(self, moment: Moment) -> bool:
        world = moment.world
        if moment.step == 0 or world.entities[self.entity].support in world.contacts(self.entity):
            return False
        return world.fingers_on(self.entity) >= 2


@dataclass(frozen=True)
class Above(Trigger):
    """The first step that leaves the end effector above a receptacle."""

    type = "above"
    spelling: ClassVar[Mapping[str, str]] = {"receptacle": "value"}

    receptacle: _Entity
    """Name of the entity."""
    radius_m: Length = ABOVE_RADIUS_M
    """Largest horizontal distance of the end effector from its position, m."""

    def fires(self, moment: Moment) -> bool:
        if moment.step == 0:
            return False
        offset = moment.world.end_effector() - moment.world.position(self.receptacle)
        x, y, z = offset.tolist()
        return z > 0.0 and math.sqrt(x * x + y * y) <= self.radius_m


@dataclass(frozen=True)
class BudgetFraction(Trigger):
    """The first step after which a share of the episode's budget is spent."""

    type = "budget_fraction"
    spelling: ClassVar[Mapping[str, str]] = {"share": "value"}

    share: _Fraction
    """Above 0, below 1."""

    def fires(self, moment: Moment) -> bool:
        return moment.step >= self.share * moment.budget


def _accept(name: str, candidate: object) -> type[Trigger]:
    """Return the class of triggers that was registered under ``name``."""
    if not (isinstance(candidate, type) and issubclass(candidate, Trigger) and is_dataclass(candidate)):
        raise ValueError(
            f"{candidate!r} is not a frozen dataclass that extends pytest_libero_max.events.triggers.Trigger"
        )
    if candidate.fires is Trigger.fires:
        raise ValueError(f"{candidate.__name__} has no rule: define fires(self, moment)")
    return candidate


TRIGGERS: Registry[type[Trigger]] = Registry(
    "trigger",
    "pytest_libero_max.triggers",
    given("type", Proximity, AtStart, StepsAfter, Untouched, AfterGrasp, Above, BudgetFraction),
    _accept,
    ManifestError,
    attribute="type",
)
"""Every trigger by its type: this package's, then those that installed packages add."""
