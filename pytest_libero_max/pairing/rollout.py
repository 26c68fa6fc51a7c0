"""A rollout that is driven from outside: it says which query is next, takes the answer, and plays on.

Everything else happens inside: entries of schedules fire, actions are executed, the hash chain grows, probes
are asked. The runner, a batch of pairs and the environment for other loops all drive this one loop::

    while (query := rollout.due()) is not None:
        rollout.answer(my_policy(rollout.observed(), query))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ActionError, ProtocolError
from pytest_libero_max.events.schedules import BASE, Arm, Entry, Revert
from pytest_libero_max.events.triggers import Moment, distance_m
from pytest_libero_max.pairing.changing import apply_change
from pytest_libero_max.pairing.consistency import Memory, RecordedQuery, is_sampled
from pytest_libero_max.pairing.prefix import BranchPoint
from pytest_libero_max.pairing.probes.probe import Value, View
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.pairing.trajectory import Firing, QueryResult, Step, Trajectory, next_link
from pytest_libero_max.policies.check import check_actions, sees
from pytest_libero_max.policies.contract import BatchItem, Query
from pytest_libero_max.policies.transforms.states import axis_angle, grip_site_quaternion
from pytest_libero_max.worlds.contract import Array, Observation, WorldState
from pytest_libero_max.worlds.robot import ACTION_DIM, ORIENTATION_KEY, Robot


@dataclass(frozen=True)
class RolloutResult:
    """A rollout that has ended. Everything in it counts from the first policy step, prefix included."""

    trajectory: Trajectory
    probes: Mapping[str, Mapping[str, Value]]
    robot: Robot

    @property
    def success(self) -> bool:
        """True if the task was completed within the budget, or the policy stopped where it was cancelled."""
        return self.trajectory.success

    @property
    def steps(self) -> int:
        """Number of policy steps taken."""
        return self.trajectory.step

    @property
    def actions(self) -> NDArray[np.float64]:
        """(steps, d) as the policy returned them."""
        return self.trajectory.actions

    @property
    def end_effector(self) -> Array:
        """(steps, 3) m, world frame, after each step."""
        return self.trajectory.end_effector

    @property
    def entity(self) -> Array:
        """(steps, 3) m, world frame: the trigger entity after each step."""
        return self.trajectory.entity

    @property
    def joints(self) -> NDArray[np.float32] | None:
        """(steps, nq) positions of all joints after each step; None where they were not kept."""
        return self.trajectory.joints

    @property
    def queries(self) -> tuple[QueryResult, ...]:
        """Every query with all the actions it returned."""
        return self.trajectory.queries

    @property
    def firings(self) -> tuple[Firing, ...]:
        """The entries of the schedule that happened, in order."""
        return self.trajectory.firings

    @property
    def proof(self) -> str:
        """Last link of the hash chain, hexadecimal."""
        return self.trajectory.proof


@dataclass(frozen=True)
class Parted:
    """Arms that have shared everything so far, and the branch point from which they go on."""

    arms: tuple[Arm, ...]
    branch: BranchPoint | None = None
    """The branch point; None: the start."""


class Rollout:
    """A rollout while it is being played: of one arm, or of several as long as they share everything.

    Begin one with :meth:`start` or :meth:`resume`. Where arms part, those in which nothing happens go on
    here, and the others are left in :attr:`parted`.

    Attributes:
        recorded: A late query, to be asked again: the last one as long as arms may part, one of the last four
            afterwards. None where there is none, or the policy does not repeat itself.
    """

    def __init__(self, stage: Stage, trajectory: Trajectory, arms: Sequence[Arm]) -> None:
        self.trajectory = trajectory
        self.parted: list[Parted] = []
        self.recorded: RecordedQuery | None = None
        self._stage = stage
        self._entity, self._budget, self._sees = stage.entity, stage.case.budget, sees(stage.policy)
        self._due: Query | None = None
        self._kept: tuple[WorldState, bytes, Memory | None] | None = None
        self._go_on_with(tuple(arms))

    @classmethod
    def start(cls, stage: Stage, arms: Sequence[Arm] = (Arm(BASE),)) -> Rollout:
        """Return a rollout from the beginning: reset, shared setup, settle steps.

        The policy is told that an episode begins right before its first query, after what a schedule does at
        the start.
        """
        stage.begin_world()
        world = stage.world
        distance = distance_m(world.end_effector(), world.position(stage.entity))
        latency = arms[0].latency.drawn_for(stage.case.case_id)
        begun = Trajectory.begin(stage.spec.query_interval, world.digest(), distance, latency)
        rollout = cls(stage, begun, arms)
        rollout.trajectory = rollout.trajectory.watched(stage.probes.start(rollout._view()))
        return rollout

    @classmethod
    def resume(cls, branch: BranchPoint, stage: Stage, arms: Sequence[Arm] = (Arm(BASE),)) -> Rollout:
        """Return the rollout that goes on from a branch point; world and policy are there already.

        Where the world has been altered since, its new digest goes into the hash chain first. Without an
        alteration the rollout is the one that was branched from.
        """
        rollout = cls(stage, branch.trajectory.altered(stage.world.digest()), arms)
        rollout.recorded = branch.recorded
        return rollout

    @property
    def success(self) -> bool:
        """True if the last step completed the task."""
        return self.trajectory.success

    @property
    def running(self) -> bool:
        """True if the episode goes on: budget is left, and the task is cancelled or not completed."""
        return self.trajectory.running(self._budget)

    # Driving it.

    def due(self) -> Query | None:
        """Play on to the next query and return it; None at the end of the episode.

        Entries of the schedule fire, and queued actions are executed; where the latency of the arms leaves
        none, the robot waits. The same query is returned until it is answered.

        Raises:
            SimulatorError: The simulation broke.
            ProtocolError: A change left the world bit for bit as it was.
            ChangeError: A change does not fit this world, or cannot be taken back.
            ProbeError: A probe raised or wrote to the world.
        """
        while self._due is None and self.running:
            self.let_happen()
            if self.trajectory.queued:
                self._execute()
            else:
                self._due = self._next_query()
        return self._due

    def observed(self) -> Observation:
        """Return the observation of the world as it is now, in the cameras and size of the stage's spec."""
        return self._stage.observed()

    def item(self) -> BatchItem:
        """Return the query that is due with all that an answer may depend on."""
        return BatchItem(self.observed(), self._require_due(), self._stage.episode)

    def answer(self, actions: ArrayLike, notes: Mapping[str, int] | None = None) -> None:
        """Answer the query that is due, or raise ActionError or ProtocolError.

        Args:
            actions: (n, 7), Q <= n <= H (chunk size), of which the first Q will be executed.
            notes: Counts of the query, by name, for the record.
        """
        self._require_due()
        # The numbers are ours: whoever answers has had the query in their hands.
        index, step = len(self.trajectory.queries), self.trajectory.step
        try:
            checked = check_actions(actions, self._stage.spec)
        except ActionError as error:
            raise error.within(f"query {index} at step {step}") from error
        self._take(QueryResult(index, step, checked, notes))

    def execute(self, action: NDArray[np.float64]) -> None:
        """Execute one action of a loop that keeps the queue itself; call :meth:`let_happen` before and after.

        A query counts as made at the first of every Q actions.

        Args:
            action: (7,), checked.
        """
        trajectory, step = self.trajectory, self.trajectory.step
        if not trajectory.queued:
            chunk = np.tile(action, (trajectory.query_interval, 1))
            self._take(QueryResult(len(trajectory.queries), step, chunk))
        else:
            last = trajectory.queries[-1]
            chunk = last.actions.copy()
            chunk[step - last.step :] = action
            queries = (*trajectory.queries[:-1], replace(last, actions=chunk))
            self.trajectory = replace(trajectory, queries=queries)
        self._execute()

    # Driving it with the policy of the stage.

    def ask(self) -> None:
        """Ask the stage's policy the query that is due; the first begins its episode.

        Raises:
            AdapterError: The policy broke its contract.
        """
        query = self._require_due()
        if query.index == 0:
            self._stage.begin_policy()
        self._take(self._stage.ask(query))

    def advance(self) -> None:
        """Execute one action, after the entries that fire now, and after a query if none is queued."""
        self.let_happen()
        if not self.trajectory.queued:
            self._due = self._due or self._next_query()
            self.ask()
        self._execute()

    def advance_to_end(self) -> RolloutResult:
        """Play to the end of the episode."""
        while self.due() is not None:
            self.ask()
        return self.result()

    # What happens between steps, and what is kept.

    def let_happen(self) -> None:
        """Let the entries of the schedules happen whose moment is now; arms may part.

        The errors are those of :meth:`due`.
        """
        if self.trajectory.just_asked:  # triggers were asked before the query
            return
        while self.running and (happening := self._happening()):
            if len(self._groups) == 1:
                self._fire(happening[0])
                self._go_on_with(self.arms)
            else:
                self._part(happening)

    def branch(self) -> BranchPoint:
        """Return the rollout as it is now, as a value, or raise AdapterError or ProbeError."""
        self._stage.probes.require_values(self.trajectory.seen)
        return BranchPoint(
            trajectory=self.trajectory,
            state=self._stage.world.snapshot(),
            memory=Memory.of(self._stage.policy) if self.trajectory.executed else None,
            recorded=self.recorded,
        )

    def result(self) -> RolloutResult:
        """Return the result of a rollout that is not running any more; the world is still at its end.

        Raises:
            ProbeError: A probe raised, wrote to the world, or yields something else than it declares.
        """
        columns = self._stage.probes.columns(self._view())
        return RolloutResult(self.trajectory, columns, self._stage.world.robot)

    # Inside.

    def _require_due(self) -> Query:
        if self._due is None:
            raise ProtocolError(
                "no query is due in this rollout. Call due() until it returns a query, then answer it once."
            )
        return self._due

    def _next_query(self) -> Query:
        """Return the next query; keep what is needed to ask it again, where it will be."""
        stage, trajectory = self._stage, self.trajectory
        index = len(trajectory.queries)
        if stage.spec.repeatable and (self._may_part or is_sampled(index, stage.case.case_id)):
            # Before its first query a policy may not have a memory to copy yet.
            memory = Memory.of(stage.policy) if index else None
            self._kept = (stage.world.snapshot(), trajectory.digest, memory)
        return stage.query(index, trajectory.step, trajectory.reseeds)

    def _take(self, result: QueryResult) -> None:
        """Go on with a checked answer to the query that is due."""
        result.actions.setflags(write=False)
        result = replace(result, reseeds=self.trajectory.reseeds) if self.trajectory.reseeds else result
        if self._kept is not None:
            self.recorded = RecordedQuery(result, *self._kept)
        self._due = self._kept = None
        self.trajectory = self.trajectory.answered(result)
        if self._stage.probes.on_queries:
            self._watch("query")

    def _execute(self) -> None:
        """Execute the next of the queued actions."""
        stage, world, trajectory = self._stage, self._stage.world, self.trajectory
        if self._sees and not trajectory.just_asked:
            stage.show(trajectory.step)
        stage.watch.step()
        queued = trajectory.next_action
        action = self._held() if queued is None else queued
        world.step(action)
        digest, success = world.digest(), world.succeeded()
        end_effector, entity = world.end_effector(), world.position(self._entity)
        end_effector.setflags(write=False)
        entity.setflags(write=False)
        distance, link = distance_m(end_effector, entity), next_link(trajectory.link, action, digest)
        step = Step(action, end_effector, entity, distance, success, link, stage.joints(), queued is None)
        self.trajectory = trajectory.stepped(step, digest)
        if stage.probes.on_steps:
            self._watch("step")

    def _held(self) -> NDArray[np.float64]:
        """Return the action of a robot that waits for an answer: it stands still, the gripper as it is.

        Under absolute control the last pose is asked for again, or, before the first one, the present pose.
        """
        executed, world = self.trajectory.executed, self._stage.world
        noop = world.robot.noop
        if self._stage.spec.control == "delta":
            return np.array([*noop[:-1], executed[-1].action[-1] if executed else noop[-1]])
        if executed:
            return executed[-1].action
        turn = noop[3:-1]  # none, for a robot whose hand keeps its orientation
        if len(noop) == ACTION_DIM and ORIENTATION_KEY in world.robot.state:
            turn = tuple(axis_angle(grip_site_quaternion(world.observe(())[ORIENTATION_KEY])))
        return np.array([*world.end_effector(), *turn, noop[-1]])

    def _watch(self, what: Literal["step", "query"]) -> None:
        self.trajectory = self.trajectory.watched(self._stage.probes.after(what, self._view()))

    def _view(self) -> View:
        stage = self._stage
        return View(stage.world, self.trajectory, self._entity, self._budget, stage.spec.control)

    def _go_on_with(self, arms: tuple[Arm, ...]) -> None:
        done = len(self.trajectory.firings)
        self.arms = arms
        self._groups = _by_next_entry(arms, done)
        self._may_part = any(
            (arm.schedule[done:], arm.policy) != (arms[0].schedule[done:], arms[0].policy) for arm in arms
        )

    def _happening(self) -> list[Entry]:
        """Return the next entries of the arms whose moment is now."""
        entries = [entry for entry, _ in self._groups if entry is not None]
        if not entries:
            return []
        fired = tuple(firing.step for firing in self.trajectory.firings)
        moment = Moment(self.trajectory.step, self._budget, self._stage.world, fired)
        return [entry for entry in entries if entry.trigger.fires(moment)]

    def _fire(self, entry: Entry) -> None:
        """Let an entry happen in all arms that are being played."""
        stage, action = self._stage, entry.action
        with stage.clock("event_s"):
            if isinstance(action, Revert):
                earlier = self.trajectory.firings[action.entry].applied
                change = earlier.change.reverted(earlier.evidence)
            else:
                change = action
            applied = apply_change(change, stage.world, stage.spec, stage.case.item_id, stage.images)
        self.trajectory = self.trajectory.fired(entry, applied, stage.world.digest())

    def _part(self, happening: list[Entry]) -> None:
        """Go on with the arms in which nothing happens now; or, where something does in all, with the first.

        The others part from them here.
        """
        quiet = tuple(arm for entry, group in self._groups if entry not in happening for arm in group)
        leaving = self._groups if quiet else self._groups[1:]
        branch = self.branch()
        self.parted += [Parted(group, branch) for entry, group in leaving if entry in happening]
        self._go_on_with(quiet or self._groups[0][1])


def _by_next_entry(arms: Sequence[Arm], done: int) -> list[tuple[Entry | None, tuple[Arm, ...]]]:
    """Return the arms by their next entry; None for arms without one. An arm of another policy is alone."""
    groups: list[tuple[Entry | None, tuple[Arm, ...]]] = []
    for arm in arms:
        entry = arm.schedule[done] if done < len(arm.schedule) else None
        alike = (i for i, (known, group) in enumerate(groups) if known == entry and group[0].policy is None)
        place = next(alike, None) if arm.policy is None else None
        if place is None:
            groups.append((entry, (arm,)))
        else:
            groups[place] = (entry, (*groups[place][1], arm))
    return groups
