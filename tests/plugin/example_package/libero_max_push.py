"""An event, somebody bumps into the target before it is grasped, in a package of its own.

Besides it a trigger, a stopping rule, a probe, and a section of the report on what the probe reads.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max import (
    Change,
    EventKind,
    Evidence,
    Measured,
    Moment,
    PairError,
    PairRecord,
    PlayedPairs,
    Probe,
    ReportSection,
    Scenario,
    StoppingRule,
    Trigger,
)
from pytest_libero_max.changes import Factor, ManifestFields, Vector3, strength_of
from pytest_libero_max.errors import ChangeError, ManifestError
from pytest_libero_max.probes import Column, View

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max import AlterableWorld, Entity, Identity, TaskMetadata

DIRECTIONS = 8
"""Number of directions along the table; the identity of a case says which one it is."""

SPEEDS_M_S = (0.3, 0.5)
"""Speed that the target is given, by variant: it slides for one or two centimetres."""


@dataclass(frozen=True)
class PushObject(ManifestFields):
    """Give an object a velocity.

    Attributes:
        object: The object.
        velocity_m_s: Added to its linear velocity, world frame.
    """

    operation: ClassVar[str] = "push_object"

    object: str
    velocity_m_s: Vector3

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({f"pose:{self.object}"})

    def apply(self, world: AlterableWorld) -> Evidence:
        before = {"position_m": world.position(self.object).tolist()}
        if any(self.velocity_m_s):
            world.push(self.object, self.velocity_m_s)
        after = {"position_m": world.position(self.object).tolist()}
        return Evidence(self.operation, tuple(self.factors), before, after)

    def scaled(self, strength: float) -> PushObject:
        """The push with its velocity multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        x, y, z = self.velocity_m_s
        return replace(self, velocity_m_s=(x * s, y * s, z * s))

    def reverted(self, evidence: Evidence) -> Change:
        raise ChangeError("push_object cannot be taken back: the object has moved since.")


class Push(EventKind):
    """The target is given a velocity along the table."""

    name = "push"
    family = "dynamics"
    code = "DYN"
    severities = ("medium", "high")
    response = "replan"
    needs = "a movable target that was put on a table or floor."
    expected = "Plan again: the object to grasp has slid away."

    def eligible(self, task: TaskMetadata) -> bool:
        return task.planar(task.primary_target)

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        angle = 2.0 * math.pi * identity.direction_index(self.name) / DIRECTIONS
        speed = SPEEDS_M_S[variant]
        velocity = [round(math.cos(angle) * speed, 8), round(math.sin(angle) * speed, 8), 0.0]
        return Scenario({"operation": "push_object", "object": task.primary_target, "velocity_m_s": velocity})

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Pushes of the trigger entity in any direction along the table."""
        from hypothesis import strategies as st

        component = st.floats(-0.5, 0.5)
        pushes = st.builds(PushObject, st.just(trigger), st.tuples(component, component, st.just(0.0)))
        return pushes.map(lambda push: Scenario(push.to_dict()))


@dataclass(frozen=True)
class HandBelow(Trigger):
    """The first step that leaves the hand below a height.

    Attributes:
        height_m: In m, world frame.
    """

    type = "hand_below"

    height_m: float

    def __post_init__(self) -> None:
        if not isinstance(self.height_m, int | float):
            raise ManifestError(f"hand_below.height_m={self.height_m!r}, but must be a height in metres.")

    def fires(self, moment: Moment) -> bool:
        return moment.step > 0 and float(moment.world.end_effector()[2]) < self.height_m


class OutcomeCount(StoppingRule):
    """Stops a run at the N-th pair of an outcome: ``outcomes:OUTCOME:N``."""

    def __init__(self, arguments: str) -> None:
        self.outcome, _, number = arguments.partition(":")
        if not number.isdigit():
            raise ValueError("give an outcome and a number, for example outcomes:regression:3")
        self.number = self.left = int(number)

    def after(self, pair: PairRecord | PairError) -> str | None:
        self.left -= isinstance(pair, PairRecord) and pair.outcome == self.outcome
        return None if self.left > 0 else f"{self.number} pairs end as {self.outcome}"


HandState = tuple[float, tuple[float, ...]]


class FastestMove(Probe[HandState]):
    """The longest way of the hand within one step."""

    name = "fastest_move"
    schema = (Column("way_m", "float", "Longest way of the hand within one policy step", "m"),)
    cost = "0.01 ms a step"

    def start(self, view: View) -> HandState:
        return 0.0, tuple(view.world.end_effector())

    def step(self, state: HandState, view: View) -> HandState:
        longest, before = state
        here = tuple(view.world.end_effector())
        return max(longest, math.dist(before, here)), here

    def columns(self, state: HandState, view: View) -> Mapping[str, float]:
        return {"way_m": state[0]}


FAST_M = 0.03
"""Way of the hand within one step that counts as fast."""


class FastMoves(ReportSection):
    """Rollouts in which the hand moved fast, of the pairs that the probe watched."""

    name = "fast-moves"
    quantities = tuple(
        Measured(f"fast_moves.{arm}", f"{arm} moves fast", "share", FastestMove.name, f"Fast in {arm}")
        for arm in ("base", "dynamic")
    )

    def tables(self, played: PlayedPairs) -> dict[str, dict[str, Any]]:
        watched = [record for record in played.records if FastestMove.name in record.arms["dynamic"].probes]
        if not watched:
            return {}
        rows: dict[str, Any] = {"Pairs watched": len(watched)}
        for quantity, arm in zip(self.quantities, ("base", "dynamic"), strict=True):
            ways = (record.arms[arm].probes[FastestMove.name]["way_m"] for record in watched)
            rows |= quantity.share(way > FAST_M for way in ways)
        return {"Fast moves": rows}
