"""Changes of the instruction and of the goal that decides success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pytest_libero_max.benchmark.structs import AnyText, Text, rule
from pytest_libero_max.changes.change import Evidence, Factor, check_evidence
from pytest_libero_max.changes.fields import ManifestFields, all_or_nothing
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.reversal import Reversal, frozen, saved
from pytest_libero_max.worlds.contract import AlterableWorld


@dataclass(frozen=True)
class SetInstruction(ManifestFields):
    """Give the same task in other words.

    Attributes:
        instruction: The policy's instruction from now on; empty for none.
        style: Kind of the rewording; a note that no policy sees.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "set_instruction"

    instruction: AnyText
    style: Text | None = None

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


_Fact = Annotated[tuple[Text, ...], rule("a predicate and one or two names", min_length=2, max_length=3)]
_Goal = Annotated[tuple[_Fact, ...], rule("a non-empty list of predicates", min_length=1)]


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

    instruction: Text
    goal: _Goal

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
