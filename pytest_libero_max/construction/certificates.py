"""Certificates: results of a scripted expert on cases, which decide nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import World

Ending = Literal["solved", "not_triggered", "base_unsolved", "unsolved"]
"""Endings: the expert completes the Dynamic episode; it never comes near the trigger entity; it completes
the task neither with the event nor without it; it completes it without the event only."""

ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True)
class Certificate:
    """Result of the expert on a case: proof that it can be done, or that this expert cannot do it."""

    ending: Ending
    """Ending of its Dynamic episode."""
    trigger_step: int | None = None
    """Policy steps before the event; None where it did not happen."""
    steps: int | None = None
    """Policy steps of the Dynamic episode; None where the event did not happen."""

    @property
    def solved(self) -> bool:
        """True if the expert completes the case."""
        return self.ending == "solved"

    def to_dict(self) -> dict[str, Any]:
        """As JSON values; :meth:`from_dict` reads them."""
        return asdict(self)

    @classmethod
    def from_dict(cls, value: dict[str, Any]) -> Certificate:
        """Read what :meth:`to_dict` wrote.

        Raises:
            TypeError: It has other fields.
            ValueError: A value is none that a certificate can have.
        """
        found = cls(**value)
        steps = (found.trigger_step, found.steps)
        if found.ending not in ENDINGS or any(type(n) is not int for n in steps if n is not None):
            raise ValueError(f"no certificate: {value!r:.200}")
        return found


def certify(world: World, case: Case, expert: Policy) -> Certificate:
    """Play a case with an expert.

    Args:
        world: The world that plays the case.
        case: The case.
        expert: A policy that solves the tasks; images are rendered only if it asks for them.

    Raises:
        AdapterError: The expert broke its contract.
        SimulatorError: The simulation breaks.
    """
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
