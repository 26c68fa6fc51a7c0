"""One rollout while it is being played."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.events.schedules import Entry, Revert
from pytest_libero_max.events.triggers import Moment, distance_m
from pytest_libero_max.pairing.consistency import SAMPLE_INTERVAL, Asked, Memory
from pytest_libero_max.pairing.prefix import BranchPoint, Firing, event_link, first_link, next_link
from pytest_libero_max.pairing.queue import ActionQueue
from pytest_libero_max.pairing.stage import Answer, Stage, apply_change
from pytest_libero_max.policies.check import sees
from pytest_libero_max.worlds.contract import Array, Control


@dataclass(frozen=True)
class RolloutResult:
    """A rollout that has ended. Everything in it counts from the first policy step, prefix included.

    Attributes:
        success: Whether the task was completed within the budget.
        steps: Policy steps taken.
        actions: (steps, 7) as the policy returned them.
        end_effector: (steps, 3) m, world frame, after each step.
        entity: (steps, 3) m, world frame: the trigger entity after each step.
        min_distance_m: Smallest distance of the two.
        answers: Every query with all the actions it returned.
        firings: The entries of the schedule that happened, in order.
        contacts: What touches the trigger entity at the end.
        proof: Last link of the hash chain, hexadecimal.
        control: What the actions are.
    """

    success: bool
    steps: int
    actions: NDArray[np.float64]
    end_effector: Array
    entity: Array
    min_distance_m: float
    answers: tuple[Answer, ...]
    firings: tuple[Firing, ...]
    contacts: tuple[str, ...]
    proof: str
    control: Control = "delta"

    @property
    def clipped_components(self) -> int:
        """How many of the 7 * steps components of the executed actions are beyond +-1: they are clipped.

        Of poses only the gripper is.
        """
        clipped = self.actions if self.control == "delta" else self.actions[:, -1]
        return int((np.abs(clipped) > 1.0).sum())


class Rollout:
    """A rollout between two steps: the stage, the queue of actions, and the record of what happened.

    Begin one with :meth:`start` or :meth:`resume`, and :meth:`advance` it while it is :attr:`running`.

    Attributes:
        success: Whether the last step completed the task.
        distance_m: Distance of the end effector to the trigger entity after the last step, or at the start.
        min_distance_m: The smallest after a step so far; infinite before the first step.
        firings: The entries of the schedule that have happened.
        may_branch: Whether a branch point may still be taken. What only branch points need is kept as long
            as it is true.
        asked: A late query, to be asked again: the last one as long as branch points may be taken, one of the
            last four afterwards. None where there is none, or the policy does not repeat itself.
    """

    def __init__(self, stage: Stage, pending: NDArray[np.float64] | None = None) -> None:
        self.success = False
        self.distance_m = math.inf
        self.min_distance_m = math.inf
        self.firings: list[Firing] = []
        self.may_branch = True
        self.asked: Asked | None = None
        self._stage = stage
        self._queue = ActionQueue(stage.spec.query_interval, pending)
        self._actions: list[NDArray[np.float64]] = []
        self._end_effector: list[Array] = []
        self._entity: list[Array] = []
        self._answers: list[Answer] = []
        self._chain: list[bytes] = []
        self._digest = b""

    @classmethod
    def start(cls, stage: Stage) -> Rollout:
        """A rollout from the beginning: reset, shared setup, settle steps.

        The policy is told that an episode begins right before the first step, after what the schedule does
        at the start.
        """
        stage.begin_world()
        rollout = cls(stage)
        rollout._digest = stage.world.digest()
        rollout._chain = [first_link(rollout._digest)]
        rollout.distance_m = distance_m(stage.world.end_effector(), stage.world.position(stage.entity))
        return rollout

    @classmethod
    def resume(cls, branch: BranchPoint, stage: Stage) -> Rollout:
        """The rollout that goes on from a branch point; world and policy are there already.

        Where the world has been altered since, its new digest goes into the hash chain first. Without an
        alteration the rollout is the one that was branched from.
        """
        rollout = cls(stage, branch.pending)
        rollout.distance_m, rollout.min_distance_m = branch.distance_m, branch.min_distance_m
        rollout.firings = list(branch.firings)
        rollout._actions = list(branch.actions)
        rollout._end_effector = list(branch.end_effector)
        rollout._entity = list(branch.entity)
        rollout._answers = list(branch.answers)
        rollout.asked = branch.asked
        rollout._chain, rollout._digest = list(branch.chain), branch.digest
        rollout._note_change()
        return rollout

    @property
    def steps(self) -> int:
        """Policy steps executed."""
        return len(self._actions)

    @property
    def running(self) -> bool:
        """Whether the episode goes on: the task is not completed and budget is left."""
        return not self.success and len(self._actions) < self._stage.case.budget

    @property
    def moment(self) -> Moment:
        """What triggers are asked about."""
        fired = tuple(firing.step for firing in self.firings)
        return Moment(self.steps, self._stage.case.budget, self._stage.world, fired)

    def advance(self) -> None:
        """Execute one action, after a query if none is queued.

        Raises:
            AdapterError: The policy broke its contract.
            SimulatorError: The simulation broke.
        """
        stage, world = self._stage, self._stage.world
        if not self._actions:
            stage.begin_policy()
        if not self._queue:
            self._query()
        elif sees(stage.policy):
            stage.show(len(self._actions))
        action = self._queue.pop()
        stage.watch.step()
        world.step(action)
        self._digest = world.digest()
        self._actions.append(action)
        self._chain.append(next_link(self._chain[-1], action, self._digest))
        self.success = world.succeeded()
        end_effector, entity = world.end_effector(), world.position(stage.entity)
        self._end_effector.append(end_effector)
        self._entity.append(entity)
        self.distance_m = distance_m(end_effector, entity)
        self.min_distance_m = min(self.min_distance_m, self.distance_m)

    def advance_to_end(self) -> RolloutResult:
        """Play to the end of the episode, whatever the schedule says."""
        self.may_branch = False
        while self.running:
            self.advance()
        return self.result()

    def fire(self, entry: Entry) -> None:
        """Let an entry of the schedule happen now.

        Raises:
            ProtocolError: It left the world bit for bit as it was.
            ChangeError: It does not fit this world, or cannot be taken back.
        """
        stage, action = self._stage, entry.action
        proof = self._chain[-1].hex()
        with stage.clock("event_s"):
            if isinstance(action, Revert):
                earlier = self.firings[action.entry].applied
                change = earlier.change.reverted(earlier.evidence)
            else:
                change = action
            applied = apply_change(change, stage.world, stage.spec, stage.case.item_id)
        self.firings.append(Firing(entry, self.steps, len(self._answers), self.distance_m, proof, applied))
        self._note_change()

    def branch(self) -> BranchPoint:
        """The rollout as it is now, as a value.

        Raises:
            AdapterError: The policy's snapshot raised.
        """
        return BranchPoint(
            step=self.steps,
            distance_m=self.distance_m,
            min_distance_m=self.min_distance_m,
            state=self._stage.world.snapshot(),
            digest=self._digest,
            memory=Memory.of(self._stage.policy) if self._actions else None,
            pending=self._queue.pending,
            actions=np.array(self._actions),
            end_effector=np.array(self._end_effector),
            entity=np.array(self._entity),
            answers=tuple(self._answers),
            asked=self.asked,
            firings=tuple(self.firings),
            chain=tuple(self._chain),
        )

    def result(self) -> RolloutResult:
        """What has been played, of a rollout that is not running any more."""
        return RolloutResult(
            success=self.success,
            steps=self.steps,
            actions=np.array(self._actions),
            end_effector=np.array(self._end_effector),
            entity=np.array(self._entity),
            min_distance_m=self.min_distance_m,
            answers=tuple(self._answers),
            firings=tuple(self.firings),
            contacts=self._stage.world.contacts(self._stage.entity),
            proof=self._chain[-1].hex(),
            control=self._stage.spec.control,
        )

    def _query(self) -> None:
        stage = self._stage
        index = len(self._answers)
        keep = stage.spec.repeatable and (self.may_branch or index % SAMPLE_INTERVAL == 0)
        # Before its first query a policy may not have a memory to copy yet.
        memory = Memory.of(stage.policy) if keep and index else None
        state = stage.world.snapshot() if keep else None
        answer = stage.ask(index, self.steps)
        if state is not None:
            self.asked = Asked(answer, state, self._digest, memory)
        self._answers.append(answer)
        self._queue.refill(answer.actions)

    def _note_change(self) -> None:
        """Add a link to the hash chain if the world is not what it was after the last one."""
        digest = self._stage.world.digest()
        if digest != self._digest:
            self._chain.append(event_link(self._chain[-1], digest))
            self._digest = digest
