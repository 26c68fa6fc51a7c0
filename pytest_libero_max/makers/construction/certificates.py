"""The play of a scripted expert on a case, for its certificate."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import Certificate, Ending
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import World


def certify(world: World, case: Case, expert: Policy) -> Certificate:
    """Play a case with a policy that solves the tasks; images are rendered only if it asks for them."""
    stage = Stage(case, world, expert)
    _, dynamic, *_ = arms_of(case)
    result = Rollout.start(stage, (dynamic,)).advance_to_end()
    if not result.firings:
        return Certificate("not_triggered")
    ending: Ending = "solved"
    if not result.success:
        without_event = Rollout.start(stage).advance_to_end()
        ending = "unsolved" if without_event.success else "base_unsolved"
    return Certificate(ending, result.firings[0].step, result.steps)
