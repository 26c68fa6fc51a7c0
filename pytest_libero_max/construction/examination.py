"""One case in the simulator: its preflight, and whether a scripted expert completes it after the event."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.construction.preflight import Problem, problems
from pytest_libero_max.pairing.prefix import BranchPoint
from pytest_libero_max.pairing.runner import continue_rollout, inject, play_prefix, return_to
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import World


@dataclass(frozen=True)
class Certificate:
    """How the expert's Dynamic rollout ended: that it can be done, or that the expert could not.

    Attributes:
        solved: Whether the task was completed.
        trigger_step: Policy steps before the event.
        steps: Policy steps in all.
    """

    solved: bool
    trigger_step: int
    steps: int


@dataclass(frozen=True)
class Examination:
    """What the preflight and the expert found out about a case.

    Attributes:
        case_id: Which.
        case_digest: SHA-256 of the case, hexadecimal.
        problems: What the preflight found; it passed where there are none.
        certificate: None where it did not pass.
    """

    case_id: str
    case_digest: str
    problems: tuple[Problem, ...]
    certificate: Certificate | None

    @property
    def passed(self) -> bool:
        return not self.problems

    def to_dict(self) -> dict[str, Any]:
        """As JSON values; :meth:`from_dict` reads them."""
        found = self.certificate
        return {
            "case_id": self.case_id,
            "case_digest": self.case_digest,
            "problems": [[problem.check, problem.detail] for problem in self.problems],
            "certificate": found and [found.solved, found.trigger_step, found.steps],
        }

    @classmethod
    def from_dict(cls, value: dict[str, Any]) -> Examination:
        found = value["certificate"]
        return cls(
            value["case_id"],
            value["case_digest"],
            tuple(Problem(check, detail) for check, detail in value["problems"]),
            found and Certificate(*found),
        )


def examine(world: World, case: Case, expert: Policy | None) -> Examination:
    """Look at a case before any policy is scored on it.

    The expert's approach brings the hand to the trigger. If nothing speaks against the case, the expert goes
    on from there with the event; the outcome is noted and never decides which cases are used.

    Args:
        world: The world that plays the case.
        case: The case.
        expert: A policy that solves the tasks; images are rendered only if it asks for them. None: the hand
            goes straight to the target, and there is no certificate.

    Raises:
        AdapterError: The expert broke its contract.
        SimulatorError: The simulation breaks after the event.
    """
    if expert is None:
        return Examination(case.case_id, case.digest, problems(world, case), None)
    branches: list[BranchPoint] = []

    def approach(world: World, case: Case) -> bool:
        branch = play_prefix(case, world, expert)
        if branch is not None:
            branches.append(branch)
        return branch is not None

    found = problems(world, case, approach)
    certificate = None
    if not found:
        (branch,) = branches
        return_to(branch, case, world, expert)
        inject(case, world)
        result = continue_rollout(branch, case, world, expert)
        certificate = Certificate(result.success, branch.step, result.steps)
    return Examination(case.case_id, case.digest, found, certificate)
