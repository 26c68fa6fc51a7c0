"""One arm of a pair while it is being played."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.pairing.episode import ask_policy, begin_policy, begin_world, make_query
from pytest_libero_max.pairing.prefix import Answer, BranchPoint, event_link, first_link, next_link
from pytest_libero_max.pairing.queue import ActionQueue
from pytest_libero_max.policies.check import copy_memory, memory_digest, remembers
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import Array, World, WorldState


@dataclass(frozen=True)
class RolloutResult:
    """A rollout that has ended. Everything in it counts from the first policy step, prefix included.

    Attributes:
        success: Whether the task was completed within the budget.
        steps: Policy steps taken.
        actions: (steps, 7) as the policy returned them.
        end_effector: (steps, 3) m, world frame, after each step.
        entity: (steps, 3) m, world frame: the trigger entity after each step.
        answers: Every query with all the actions it returned.
        contacts: What touches the trigger entity at the end.
        proof: Last link of the hash chain, hexadecimal.
    """

    success: bool
    steps: int
    actions: NDArray[np.float64]
    end_effector: Array
    entity: Array
    answers: tuple[Answer, ...]
    contacts: tuple[str, ...]
    proof: str


class Rollout:
    """A rollout at some step: the world, the policy, the queue between them, and the record of both.

    Begin one with :meth:`start` or :meth:`resume`, and :meth:`advance` it while it is :attr:`running`.

    Attributes:
        success: Whether the last step completed the task.
        distance_m: Distance of the end effector to the trigger entity after the last step; infinite before
            the first.
        min_distance_m: The smallest of them so far.
    """

    def __init__(self, case: Case, world: World, policy: Policy, clock: Clock, queue: ActionQueue) -> None:
        self.success = False
        self.distance_m = math.inf
        self.min_distance_m = math.inf
        self._case = case
        self._world = world
        self._policy = policy
        self._clock = clock
        self._queue = queue
        self._actions: list[NDArray[np.float64]] = []
        self._end_effector: list[Array] = []
        self._entity: list[Array] = []
        self._answers: list[Answer] = []
        self._chain: list[bytes] = []
        self._asked: WorldState | None = None
        self._keep_asked = False
        self._digest = b""

    @classmethod
    def start(cls, case: Case, world: World, policy: Policy, clock: Clock) -> Rollout:
        """A rollout from the beginning: reset, shared setup, settle steps, then the policy's reset."""
        begin_world(case, world, clock)
        rollout = cls(case, world, policy, clock, ActionQueue(policy.spec.query_interval))
        rollout._digest = world.digest()
        rollout._chain = [first_link(rollout._digest)]
        rollout._keep_asked = policy.spec.repeatable and not remembers(policy)
        begin_policy(case, world, policy, clock)
        return rollout

    @classmethod
    def resume(cls, branch: BranchPoint, case: Case, world: World, policy: Policy, clock: Clock) -> Rollout:
        """The rollout that goes on from a branch point; world and policy are there already.

        Where the world has been altered since, its new digest goes into the hash chain first. Without an
        alteration the rollout is the one that was branched from.
        """
        queue = ActionQueue(policy.spec.query_interval, branch.pending)
        rollout = cls(case, world, policy, clock, queue)
        rollout.distance_m = branch.distance_m
        rollout._actions = list(branch.actions)
        rollout._end_effector = list(branch.end_effector)
        rollout._entity = list(branch.entity)
        rollout._answers = list(branch.answers)
        rollout._chain = list(branch.chain)
        rollout._digest = world.digest()
        if rollout._digest != branch.digest:
            rollout._chain.append(event_link(rollout._chain[-1], rollout._digest))
        return rollout

    @property
    def steps(self) -> int:
        """Policy steps executed."""
        return len(self._actions)

    @property
    def running(self) -> bool:
        """Whether the episode goes on: the task is not completed and budget is left."""
        return not self.success and len(self._actions) < self._case.budget

    def advance(self) -> None:
        """Execute one action, after a query if none is queued.

        Raises:
            AdapterError: The policy broke its contract.
            SimulatorError: The simulation broke.
        """
        world = self._world
        if not self._queue:
            self._query()
        action = self._queue.pop()
        world.step(action)
        self._digest = world.digest()
        self._actions.append(action)
        self._chain.append(next_link(self._chain[-1], action, self._digest))
        self.success = world.succeeded()
        end_effector, entity = world.end_effector(), world.position(self._case.event.trigger.entity)
        self._end_effector.append(end_effector)
        self._entity.append(entity)
        x, y, z = (end_effector - entity).tolist()
        # Spelled out: a BLAS norm may round differently from one processor to the next.
        self.distance_m = math.sqrt(x * x + y * y + z * z)
        self.min_distance_m = min(self.min_distance_m, self.distance_m)

    def advance_to_trigger(self) -> BranchPoint | None:
        """Play until the trigger fires, or to the end.

        It fires after the first step that leaves the end effector within the trigger distance while the
        episode is still running. None where that never happens.
        """
        while self.running:
            self.advance()
            if self.running and self.distance_m <= self._case.event.trigger.distance_m:
                return self._branch()
        return None

    def advance_to_end(self) -> RolloutResult:
        """Play to the end of the episode."""
        while self.running:
            self.advance()
        return RolloutResult(
            success=self.success,
            steps=self.steps,
            actions=np.array(self._actions),
            end_effector=np.array(self._end_effector),
            entity=np.array(self._entity),
            answers=tuple(self._answers),
            contacts=self._world.contacts(self._case.event.trigger.entity),
            proof=self._chain[-1].hex(),
        )

    def _query(self) -> None:
        if self._keep_asked:
            self._asked = self._world.snapshot()
        query = make_query(self._case, self._world, len(self._answers), self.steps)
        actions = ask_policy(self._world, self._policy, query, self._clock)
        self._answers.append(Answer(query.index, query.step, actions))
        self._queue.refill(actions)

    def _branch(self) -> BranchPoint:
        self._keep_asked = False
        memory = copy_memory(self._policy)
        return BranchPoint(
            step=self.steps,
            distance_m=self.distance_m,
            state=self._world.snapshot(),
            digest=self._digest,
            memory=memory,
            memory_digest=memory_digest(memory),
            pending=self._queue.pending,
            actions=np.array(self._actions),
            end_effector=np.array(self._end_effector),
            entity=np.array(self._entity),
            answers=tuple(self._answers),
            asked=self._asked,
            chain=tuple(self._chain),
        )
