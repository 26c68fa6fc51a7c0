"""Members of a world that a privileged policy may read, beyond those of :class:`.contract.World`.

Both substrates answer: the embedded one by its own rules, the genuine one by the installed package's. Goal
and joints need no particular simulator (:class:`PrivilegedWorld`); the experts also read MuJoCo's state
(:class:`ExpertWorld`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, get_args, runtime_checkable

import numpy as np

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.worlds.contract import Array, OnMujoco, World

if TYPE_CHECKING:
    import mujoco

Predicate = Literal["on", "in", "open", "close", "turnon", "turnoff"]

PREDICATES: tuple[Predicate, ...] = get_args(Predicate)
"""LIBERO's predicates, as its goals spell them."""

_SLIDE = 2  # mjJNT_SLIDE; MuJoCo itself is imported by whoever has a model


@dataclass(frozen=True)
class Fact:
    """A predicate as BDDL writes it: ``("on", "plate_1", "main_table_plate_region")``."""

    predicate: Predicate
    subject: str
    place: str | None = None

    def words(self) -> tuple[str, ...]:
        """Return the fact as a goal spells it."""
        return (self.predicate, self.subject, *([] if self.place is None else [self.place]))


def facts(goal: Iterable[Sequence[str]]) -> tuple[Fact, ...]:
    """Facts of a goal, one by one.

    Raises:
        SubstrateError: A predicate is not LIBERO's.
    """
    return tuple(Fact(_predicate(word), subject, *place) for word, subject, *place in goal)


def _predicate(word: str) -> Predicate:
    if word not in PREDICATES:
        raise SubstrateError(f"predicate={word!r} is not one of LIBERO's. {did_you_mean(word, PREDICATES)}")
    return word


@dataclass(frozen=True)
class GraspablePart:
    """A part of a scene that is made to be held: a handle, a knob, a neck, a rim."""

    name: str
    """``<instance>_<part>``, for example ``wooden_cabinet_1_top_handle``."""
    entity: str
    """Entity that it is a part of."""
    body: str
    """MuJoCo body that it is fixed to; the frame of the vectors below."""
    joint: str | None
    """The joint that it moves, or None for objects."""
    pos: tuple[float, float, float]
    """Middle of the part, m."""
    along: tuple[float, float, float]
    """Unit vector along it; fingers close across it."""
    out: tuple[float, float, float]
    """Unit vector away from the entity, against which the hand approaches."""
    width: float
    """Distance of the fingers when they hold it, m."""

    def world(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Pose now: position (m), ``along`` and ``out``, each (3,) in the world frame."""
        body = data.body(self.body)
        frame = body.xmat.reshape(3, 3)
        return body.xpos + frame @ self.pos, frame @ self.along, frame @ self.out

    def motion(self, data: mujoco.MjData) -> Array:
        """Velocity (3,), world, of the part per unit of its joint's velocity; 0 without a joint."""
        if self.joint is None:
            return np.zeros(3)
        joint = data.joint(self.joint)
        if data.model.joint(self.joint).type[0] == _SLIDE:
            return np.array(joint.xaxis)
        velocity: Array = np.cross(joint.xaxis, self.world(data)[0] - joint.xanchor)
        return velocity


@runtime_checkable
class PrivilegedWorld(World, Protocol):
    """A world that also offers its goal, whether the facts of it hold, and the joints of its fixtures."""

    @property
    def goal(self) -> tuple[Fact, ...]:
        """Facts that must all hold at the end: the task's own goal, or the one assigned in its place."""

    def holds(self, fact: Fact) -> bool:
        """Return True if a predicate holds now, by the rules by which success is decided."""

    def joints(self, name: str) -> tuple[str, ...]:
        """Return the joints of a fixture, or those that a region of it moves with; none for other places."""

    def joint_position(self, joint: str) -> float:
        """Return the position of such a joint now, m of a sliding one, rad of a hinge."""

    def is_hinge(self, joint: str) -> bool:
        """Return True if a joint turns, False if it slides."""

    def region(self, name: str) -> Array | None:
        """Return the middle (3,) of a region, m, world frame; None where there is none of that name."""

    @property
    def graspable_parts(self) -> Mapping[str, GraspablePart]:
        """The parts that are made to be held, by name, as far as the substrate knows of any."""

    def part_position(self, part: GraspablePart) -> Array:
        """Return the middle (3,) of such a part now, m, world frame."""


@runtime_checkable
class ExpertWorld(PrivilegedWorld, OnMujoco, Protocol):
    """A privileged world on MuJoCo, whose state the experts read."""
