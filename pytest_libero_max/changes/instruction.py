"""Changes of the instruction and of the goal that decides success."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Struct

from pytest_libero_max.benchmark.structs import AnyText, Text, rule
from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import Offset
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.changes.reversal import Reversal, frozen, saved
from pytest_libero_max.worlds.contract import AlterableWorld, Array


@dataclass(frozen=True)
class SetInstruction(Indivisible):
    """Give the same task in other words.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_instruction"

    instruction: AnyText
    """The policy's instruction from now on; empty for none."""
    style: Text | None = None
    """Kind of the rewording; a note that no policy sees."""

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"instruction"})

    def apply(self, world: AlterableWorld) -> Evidence:
        before, former = _measure(world), _assigned(world)
        world.assign(instruction=self.instruction)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, _measure(world), former)

    def reverted(self, evidence: Evidence) -> Reversal:
        check_evidence(self, evidence)
        return Reversal(self.operation, self.factors, assigned=frozen(saved(evidence, "assigned")))


_Fact = Annotated[tuple[Text, ...], rule("a predicate and one or two names", min_length=2, max_length=3)]
_Goal = Annotated[tuple[_Fact, ...], rule("a non-empty list of predicates", min_length=1)]


@dataclass(frozen=True)
class SetTask(Indivisible):
    """Give another task in the same scene: a goal and its instruction.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_task"

    instruction: Text
    """The policy's instruction from now on."""
    goal: _Goal
    """Predicates that must all hold, for example ``[["on", "akita_black_bowl_2", "plate_1"]]``."""

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"instruction", "goal"})

    def apply(self, world: AlterableWorld) -> Evidence:
        before, former = _measure(world), _assigned(world)
        world.assign(self.instruction, self.goal)
        return Evidence(self.operation, tuple(sorted(self.factors)), before, _measure(world), former)

    def reverted(self, evidence: Evidence) -> Reversal:
        check_evidence(self, evidence)
        return Reversal(self.operation, self.factors, assigned=frozen(saved(evidence, "assigned")))


class _Said(Struct, frozen=True, forbid_unknown_fields=True):
    """A fact of a goal as the manifests of the benchmark's authors spell it."""

    predicate: Text
    arguments: Annotated[tuple[Text, ...], rule("one or two names", min_length=1, max_length=2)]


_SaidGoal = Annotated[tuple[_Said, ...], rule("a non-empty list of predicates", min_length=1)]


@dataclass(frozen=True)
class ReplaceInstruction(Indivisible):
    """Give another task in the same scene, as the authors' manifests spell it.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "replace_instruction"

    instruction: Text
    """The policy's instruction from now on."""
    alternate_goal: _SaidGoal
    """Facts that must all hold from now on: ``predicate`` and ``arguments`` of each."""
    alternate_task_id: Text | None = None
    """The task whose goal it is; a note."""

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"instruction", "goal"})

    def _task(self) -> SetTask:
        goal = tuple((fact.predicate.lower(), *fact.arguments) for fact in self.alternate_goal)
        return SetTask(self.instruction, goal)

    def apply(self, world: AlterableWorld) -> Evidence:
        return replace(self._task().apply(world), operation=self.operation)

    def reverted(self, evidence: Evidence) -> Reversal:
        check_evidence(self, evidence)
        return Reversal(self.operation, self.factors, assigned=frozen(saved(evidence, "assigned")))

    def parameters(self) -> dict[str, Any]:
        goal = [{"predicate": fact.predicate, "arguments": [*fact.arguments]} for fact in self.alternate_goal]
        return super().parameters() | {"alternate_goal": goal}


@dataclass(frozen=True)
class CancelInstruction(Indivisible):
    """Tell the policy to stop: from now on success is to stand still, and not to complete the task.

    Looked at are the first steps after the first query with the new instruction. The policy has stopped if
    within them the hand has moved little, from the first to the last and along its way, and so has the
    case's trigger entity. The episode goes on to the end of its budget; the goal that was cancelled must not
    hold after any step of it.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "cancel_instruction"

    instruction: Text
    """The policy's instruction from now on."""
    stop_window_steps: Annotated[int, rule("an integer from 2 to 520, the longest episode", ge=2, le=520)]
    """Number of steps that are looked at."""
    eef_stop_threshold_m: Offset
    """Greatest distance of the hand between the first and the last of them, m."""
    eef_path_threshold_m: Offset
    """Greatest length of its way between them, m."""
    target_stop_threshold_m: Offset
    """Greatest distance of the trigger entity between them, m."""

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"instruction"})

    def apply(self, world: AlterableWorld) -> Evidence:
        return replace(SetInstruction(self.instruction).apply(world), operation=self.operation)

    def reverted(self, evidence: Evidence) -> Reversal:
        check_evidence(self, evidence)
        return Reversal(self.operation, self.factors, assigned=frozen(saved(evidence, "assigned")))

    def stopped(self, hand: Array, entity: Array) -> bool:
        """Return True if the steps that are looked at are there, and nothing moved too much in them.

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


def _measure(world: AlterableWorld) -> dict[str, Any]:
    goal = world.assigned[1]
    return {"instruction": world.language, "goal": None if goal is None else [list(fact) for fact in goal]}


def _assigned(world: AlterableWorld) -> dict[str, Any]:
    instruction, goal = world.assigned
    return {"assigned": [instruction, None if goal is None else [list(fact) for fact in goal]]}
