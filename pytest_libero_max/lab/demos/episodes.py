"""The episodes to record, and the recording of one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.events.schedules import BASE, DYNAMIC, arms_of
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.contract import Episode, Policy, Query
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.tasks.libero_tasks import tasks
from pytest_libero_max.worlds.contract import Observation, World
from pytest_libero_max.worlds.robot import CAMERAS

_ASIDE, _TURN = 1.0, 0.2
"""The largest push, in units of an action: sideways and up, and about each axis."""


class DisturbedPolicy(WrappedPolicy):
    """Adds a random movement to some answers; the gripper's command stays the expert's.

    A learned policy errs, and then sees states that no undisturbed demonstration shows. The remedy is that of
    DART (Laskey et al., 2017): disturb the execution, and record the expert's answers.

    Attributes:
        meant: Answer of the expert to each query of the episode.

    Args:
        share: Share of the queries whose answer is disturbed, 0 to 1.
    """

    def __init__(self, expert: Policy, share: float) -> None:
        super().__init__(expert, f"disturbed={share:g}")
        self.meant: list[NDArray[np.float64]] = []
        self._share = share

    def reset(self, episode: Episode) -> None:
        self.meant = []
        super().reset(episode)

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        actions = super().predict(observation, query)
        self.meant.append(actions)
        draw = np.random.default_rng(query.seed)
        if draw.uniform() >= self._share:
            return actions
        push = np.zeros(7)
        angle, length = draw.uniform(-np.pi, np.pi), _ASIDE * np.sqrt(draw.uniform())
        push[:3] = length * np.cos(angle), length * np.sin(angle), draw.uniform(0.0, _ASIDE)
        push[3:6] = draw.uniform(-_TURN, _TURN, 3)
        return np.clip(actions + push, -1.0, 1.0)

    def meant_at(self, steps: list[int], length: int) -> NDArray[np.float64]:
        """Return the (length, 7) actions that the expert wanted, by the steps of its queries."""
        ends = [*steps[1:], length]
        return np.concatenate(
            [answer[: end - step] for answer, step, end in zip(self.meant, steps, ends, strict=True)]
        )


_WITHOUT_SETUP = "illumination_switch"
"""The event of the cases whose Base is recorded: it needs nothing of the scene and prepares nothing in it."""


@dataclass(frozen=True)
class Planned:
    """An episode to record."""

    case: Case
    arm: str
    """``base`` or ``dynamic``."""

    @property
    def name(self) -> str:
        """A name for files, for example ``libero_goal-t03-i10-base`` or ``...-target_relocation-v0``."""
        case = self.case
        what = BASE if self.arm == BASE else f"{case.event.name}-v{case.event.variant}"
        return f"{case.suite}-t{case.task_index:02d}-i{case.init_state_index:02d}-{what}"


@dataclass(frozen=True)
class Demonstration:
    """A recorded episode."""

    success: bool
    instruction: str
    event_step: int | None
    """Policy steps before the event; None where it did not happen."""
    observations: dict[str, NDArray[Any]]
    """Observation before each action, by robosuite's keys: images (T, S, S, 3) uint8 as LIBERO delivers them,
    bottom row first, and states (T, n)."""
    actions: NDArray[np.float64]
    executed: NDArray[np.float64] | None = None
    """(T, 7) executed actions, where they differ: see ``disturbed`` in :func:`record`."""


def planned(
    suites: Sequence[str], task_indices: Sequence[int] | None, inits: Sequence[int], events: Sequence[str]
) -> Iterator[Planned]:
    """Yield Base of every task and initial state, and a Dynamic episode of each event that the task can host.

    Variants of events alternate with the initial states. Without indices, all tasks of a suite are meant.

    Raises:
        OptionError: There is no such event or task.
    """
    for event in events:
        if event not in BENCHMARK_EVENTS:
            raise OptionError.seen("event", event, f". {did_you_mean(event, BENCHMARK_EVENTS)}")
    for suite in suites:
        there = [task.index for task in tasks(suite)]
        chosen = there if task_indices is None else list(task_indices)
        if unknown := sorted(set(chosen) - set(there)):
            raise OptionError(f"task={unknown[0]} of {suite}, whose tasks are 0 to {there[-1]}.")
        for index in chosen:
            metadata = task_metadata(suite, index)
            for init in inits:
                yield Planned(make_case(_WITHOUT_SETUP, suite, index, init), BASE)
                for number, event in enumerate(events):
                    if eligible(event, metadata):
                        yield Planned(
                            make_case(event, suite, index, init, variant=(init + number) % 2), DYNAMIC
                        )


def record(
    plan: Planned, world: World, policy: Policy, image_size: int, disturbed: float = 0.0
) -> Demonstration:
    """Let a policy play an episode, and record the world before every step.

    Args:
        policy: A policy that solves the tasks. The images that a privileged one asks for are not drawn.
        image_size: Side of the recorded images, pixels.
        disturbed: Share of the queries after whose answer the hand is pushed aside, until the next one.

    Raises:
        AdapterError: The policy broke its contract.
        SimulatorError: The simulation broke.
        ProtocolError: The event altered nothing.
    """
    if policy.spec.privileged:
        policy.spec = replace(policy.spec, cameras=())
    pushed = DisturbedPolicy(policy, disturbed) if disturbed else None
    policy = pushed or policy
    arm = next(arm for arm in arms_of(plan.case) if arm.name == plan.arm)
    stage = Stage(plan.case, world, policy)
    rollout = Rollout.start(stage, (arm,))
    instruction, shown = stage.instruction, []
    while rollout.running:
        rollout.let_happen()
        shown.append(world.observe(CAMERAS, image_size))
        rollout.advance()
    result = rollout.result()
    steps = [query.step for query in result.queries]
    return Demonstration(
        result.success,
        instruction,
        result.firings[0].step if result.firings else None,
        {key: np.stack([observation[key] for observation in shown]) for key in sorted(shown[0])},
        pushed.meant_at(steps, result.steps) if pushed else result.actions,
        result.actions if pushed else None,
    )
