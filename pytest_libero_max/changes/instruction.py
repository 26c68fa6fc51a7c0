"""Changes of the instruction and of the goal that decides success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Struct

from pytest_libero_max.benchmark.structs import AnyText, Text, rule
from pytest_libero_max.changes.alteration import Alteration
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import Offset
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.worlds.contract import AlterableWorld, Array, Goal


class _Assignment(Indivisible, Alteration):
    """A change of the instruction, and of the goal where it names one."""

    touched: ClassVar[frozenset[Factor]] = frozenset({"instruction"})
    instruction: str

    def _measure(self, world: AlterableWorld) -> dict[str, Any]:
        goal = world.assigned[1]
        facts = None if goal is None else [list(fact) for fact in goal]
        return {"instruction": world.language, "goal": facts}

    def _alter(self, world: AlterableWorld) -> None:
        world.assign(self.instruction, self._goal())

    def _goal(self) -> Goal | None:
        return None


@dataclass(frozen=True)
class SetInstruction(_Assignment):
    """Give the same task in other words."""

    operation: ClassVar[str] = "set_instruction"

    instruction: AnyText
    """The policy's instruction from now on; empty for none."""
    style: Text | None = None
    """Kind of the rewording; a note that no policy sees."""


_Fact = Annotated[tuple[Text, ...], rule("a predicate and one or two names", min_length=2, max_length=3)]
_Goal = Annotated[tuple[_Fact, ...], rule("a non-empty list of predicates", min_length=1)]


@dataclass(frozen=True)
class SetTask(_Assignment):
    """Give another task in the same scene: a goal and its instruction."""

    operation: ClassVar[str] = "set_task"
    touched: ClassVar[frozenset[Factor]] = frozenset({"instruction", "goal"})

    instruction: Text
    """The policy's instruction from now on."""
    goal: _Goal
    """Predicates that must all hold, for example ``[["on", "akita_black_bowl_2", "plate_1"]]``."""

    def _goal(self) -> Goal:
        return self.goal


class _PublishedFact(Struct, frozen=True, forbid_unknown_fields=True):
    """A fact of a goal as the manifests of the benchmark's authors spell it."""

    predicate: Text
    arguments: Annotated[tuple[Text, ...], rule("one or two names", min_length=1, max_length=2)]


_PublishedGoal = Annotated[tuple[_PublishedFact, ...], rule("a non-empty list of predicates", min_length=1)]


@dataclass(frozen=True)
class ReplaceInstruction(_Assignment):
    """Give another task in the same scene, as the authors' manifests spell it."""

    operation: ClassVar[str] = "replace_instruction"
    touched: ClassVar[frozenset[Factor]] = frozenset({"instruction", "goal"})

    instruction: Text
    """The policy's instruction from now on."""
    alternate_goal: _PublishedGoal
    """Facts that must all hold from now on: ``predicate`` and ``arguments`` of each."""
    alternate_task_id: Text | None = None
    """The task whose goal it is; a note."""

    def _goal(self) -> Goal:
        return tuple((fact.predicate.lower(), *fact.arguments) for fact in self.alternate_goal)

    def parameters(self) -> dict[str, Any]:
        goal = [{"predicate": fact.predicate, "arguments": [*fact.arguments]} for fact in self.alternate_goal]
        return super().parameters() | {"alternate_goal": goal}


@dataclass(frozen=True)
class CancelInstruction(_Assignment):
    """Tell the policy to stop: from now on success is to stand still, and not to complete the task.

    The first steps after the first query with the new instruction decide. The policy has stopped if in them
    the hand has moved little, from the first step to the last and along its way, and so has the case's
    trigger entity. The episode goes on to the end of its budget; the goal that was cancelled must not
    hold after any step of it.
    """

    operation: ClassVar[str] = "cancel_instruction"

    instruction: Text
    """The policy's instruction from now on."""
    stop_window_steps: Annotated[int, rule("an integer from 2 to 520, the longest episode", ge=2, le=520)]
    """Number of steps that decide."""
    eef_stop_threshold_m: Offset
    """Greatest distance of the hand between the first and the last of them, m."""
    eef_path_threshold_m: Offset
    """Greatest length of its way between them, m."""
    target_stop_threshold_m: Offset
    """Greatest distance of the trigger entity between them, m."""

    def stopped(self, hand: Array, entity: Array) -> bool:
        """Return True if the steps that decide have been played, and nothing moved too much in them.

        Args:
            hand: (n, 3) m, the hand after each step since the first query with the instruction.
            entity: (n, 3) m, the trigger entity likewise.
        """
        hand, entity = hand[: self.stop_window_steps], entity[: self.stop_window_steps]
        if len(hand) < self.stop_window_steps:
            return False
        way = float(np.linalg.norm(np.diff(hand, axis=0), axis=1).sum())
        moved, carried = (float(np.linalg.norm(places[-1] - places[0])) for places in (hand, entity))
        return (
            moved <= self.eef_stop_threshold_m
            and way <= self.eef_path_threshold_m
            and carried <= self.target_stop_threshold_m
        )
