"""Changes of the instruction and of the goal that decides success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import ManifestFields, all_or_nothing, text
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.reversal import Reversal, frozen, saved
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, Goal


@dataclass(frozen=True)
class SetInstruction(ManifestFields):
    """Give the same task in other words.

    Attributes:
        instruction: The policy's instruction from now on.
        style: Kind of the rewording; a note that no policy sees.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_instruction"

    instruction: str
    style: str | None = None

    def __post_init__(self) -> None:
        text("set_instruction.instruction", self.instruction)
        if self.style is not None:
            text("set_instruction.style", self.style)

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

    def scaled(self, strength: float) -> SetInstruction | Nothing:
        return self if all_or_nothing(self.operation, strength) else Nothing()


@dataclass(frozen=True)
class SetTask(ManifestFields):
    """Give another task in the same scene: a goal and its instruction.

    Attributes:
        instruction: The policy's instruction from now on.
        goal: Predicates that must all hold, for example ``[["on", "akita_black_bowl_2", "plate_1"]]``.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_task"

    instruction: str
    goal: Goal

    def __post_init__(self) -> None:
        text("set_task.instruction", self.instruction)
        if not isinstance(self.goal, list | tuple) or not self.goal:
            raise ChangeError.seen(
                "set_task.goal", self.goal, ", but must be a non-empty list of predicates."
            )
        for i, fact in enumerate(self.goal):
            where = f"set_task.goal[{i}]"
            if not isinstance(fact, list | tuple) or len(fact) not in (2, 3):
                raise ChangeError.seen(where, fact, ", but must be a predicate and one or two names.")
            for j, word in enumerate(fact):
                text(f"{where}[{j}]", word)
        self._set("goal", tuple(tuple(fact) for fact in self.goal))

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

    def scaled(self, strength: float) -> SetTask | Nothing:
        return self if all_or_nothing(self.operation, strength) else Nothing()


def _measure(world: AlterableWorld) -> dict[str, Any]:
    goal = world.assigned[1]
    return {"instruction": world.language, "goal": None if goal is None else [list(fact) for fact in goal]}


def _assigned(world: AlterableWorld) -> dict[str, Any]:
    instruction, goal = world.assigned
    return {"assigned": [instruction, None if goal is None else [list(fact) for fact in goal]]}
