"""A rollout so far as one value, with the hash chain that proves it.

The chain's first link is the digest of the world after the settle steps. Every executed step adds a link over
(previous link, action bytes, digest of the world after the step), every change one over (previous link,
digest of the world after the change). Two rollouts with the same link have executed the same actions and gone
through the same states, bit for bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.changes.instruction import CancelInstruction
from pytest_libero_max.changes.nothing import DelayAnswers, ReseedPolicy
from pytest_libero_max.events.schedules import Entry
from pytest_libero_max.pairing.changing import Applied
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Array


def first_link(digest: bytes) -> bytes:
    """Return the chain's beginning: 32 bytes over the world's digest when the policy takes over."""
    return hashlib.sha256(b"libero-max-chain" + digest).digest()


def next_link(link: bytes, action: NDArray[np.float64], digest: bytes) -> bytes:
    """Return the link after a step: 32 bytes over the last one, the (7,) action and the world's digest."""
    return hashlib.sha256(link + action.tobytes() + digest).digest()


def event_link(link: bytes, digest: bytes) -> bytes:
    """Return the link after an event: 32 bytes over the last one and the world's digest after it."""
    return hashlib.sha256(link + b"event" + digest).digest()


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """An executed policy step."""

    action: NDArray[np.float64]
    """(7,) as the policy returned it, or a held one."""
    end_effector: Array
    """(3,) m, world frame, after the step."""
    entity: Array
    """(3,) m, world frame: the trigger entity after the step."""
    distance_m: float
    """Distance of the two."""
    success: bool
    """True if the task's goal holds after the step."""
    link: bytes
    """The hash chain's link of the step."""
    joints: NDArray[np.float32] | None = None
    """(nq,) positions of all joints after the step, for films; None where none are to be made."""
    held: bool = False
    """True if the robot had no action to execute, and waited for an answer."""


@dataclass(frozen=True, slots=True, eq=False)
class QueryResult:
    """A query of the policy with all the actions it returned, executed or not."""

    index: int
    """Number of the query in the episode, from 0."""
    step: int
    """Policy steps executed before it."""
    actions: Actions
    """(n, 7), Q <= n <= H."""
    notes: Mapping[str, int] | None = None
    """Counts of a wrapper around the policy at the query, by name; None where it counts nothing."""
    reseeds: int = 0
    """Number of times that the policy was given new seeds before it."""
    returned: int | None = None
    """Number of actions that a server returned, before they were cut to H; None where it is not known."""
    seconds: float | None = None
    """Wall-clock time of the answer; None where it was not measured."""

    @property
    def is_asked(self) -> bool:
        """True if the policy was asked; a wrapper may have looked, and gone on with an earlier answer."""
        return self.notes is None or bool(self.notes.get("asked", 1))


@dataclass(frozen=True, slots=True, eq=False)
class Firing:
    """An entry of a schedule that has happened."""

    entry: Entry
    step: int
    """Policy steps executed before it."""
    queries: int
    """Policy queries before it."""
    distance_m: float
    """Distance of the end effector to the case's trigger entity then."""
    proof: str
    """Last link of the hash chain before it, hexadecimal."""
    applied: Applied
    """The change and its evidence; the change is the one that was made, also for a reversal."""
    link: bytes
    """The last link after it. The same as before it where the world stayed as it was."""


class HandedOver(NamedTuple):
    """The place where another policy goes on."""

    query: int
    """Number of its first query."""
    query_interval: int
    """Its Q."""
    at_once: bool = False
    """True if it is asked there, whatever is queued."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """All that has happened in a rollout, from the first policy step on.

    An immutable value: each step makes a new one, so keeping one is forking it.
    """

    query_interval: int
    """Q (execution horizon, replan steps), the actions executed of an answer."""
    first: bytes
    """The first link of the hash chain."""
    link: bytes
    """The last one."""
    digest: bytes
    """Fingerprint of the world now, 32 bytes."""
    distance_m: float
    """Distance of the end effector to the trigger entity after the last step, or at the start."""
    executed: tuple[Step, ...] = ()
    queries: tuple[QueryResult, ...] = ()
    firings: tuple[Firing, ...] = ()
    """The entries of the schedule that happened, in order."""
    seen: tuple[object, ...] = ()
    """The state of each probe, in the order of the probes."""
    latency: Latency = NO_LATENCY
    """Time that a query takes, unless a change says otherwise (:meth:`latency_of`)."""
    handed_over: HandedOver | None = None
    """The place where another policy goes on; None where none does."""

    @classmethod
    def begin(
        cls, query_interval: int, digest: bytes, distance_m: float, latency: Latency = NO_LATENCY
    ) -> Trajectory:
        """Return the trajectory before the first step.

        Args:
            query_interval: Q.
            distance_m: Distance of the end effector to the trigger entity.
            latency: Time that a query takes.
        """
        link = first_link(digest)
        return cls(query_interval, link, link, digest, distance_m, latency=latency)

    @property
    def step(self) -> int:
        """Number of policy steps executed."""
        return len(self.executed)

    @property
    def cancelled(self) -> Firing | None:
        """The firing that told the policy to stop; None where nothing did, or it was taken back."""
        last = self.firings[-1] if self.firings else None
        return last if last is not None and isinstance(last.applied.change, CancelInstruction) else None

    @property
    def success(self) -> bool:
        """True if the last step completed the task; where it was cancelled, if the policy has stopped."""
        cancelled = self.cancelled
        if cancelled is None:
            return bool(self.executed) and self.executed[-1].success
        asked = next((query.step for query in self.queries[cancelled.queries :]), self.step)
        since = self.executed[asked:]
        change = cancelled.applied.change
        assert isinstance(change, CancelInstruction)
        return not any(step.success for step in self.executed[cancelled.step :]) and change.stopped(
            np.array([step.end_effector for step in since]), np.array([step.entity for step in since])
        )

    def running(self, budget: int) -> bool:
        """Return True if the episode goes on: budget is left, and the task is cancelled or not completed."""
        return self.step < budget and (self.cancelled is not None or not self.success)

    @property
    def proof(self) -> str:
        """The last link of the hash chain, hexadecimal."""
        return self.link.hex()

    @property
    def reseeds(self) -> int:
        """Number of times that the policy was given new seeds."""
        return sum(isinstance(firing.applied.change, ReseedPolicy) for firing in self.firings)

    def latency_of(self, number: int) -> Latency:
        """Return the time that a query takes: of those made since answers were delayed, if they were."""
        for firing in reversed(self.firings):
            if firing.queries <= number and isinstance(firing.applied.change, DelayAnswers):
                return firing.applied.change.takes(self.latency)
        return self.latency

    def interval_of(self, number: int) -> int:
        """Return Q of a query: of the policy that was asked."""
        over = self.handed_over
        return self.query_interval if over is None or number < over.query else over.query_interval

    @property
    def queued(self) -> int:
        """Number of actions that will be executed before the next query, held ones included."""
        over = self.handed_over
        if not self.queries or (over is not None and over.at_once and len(self.queries) == over.query):
            return 0
        last = len(self.queries) - 1
        interval = self.latency_of(last).interval(self.interval_of(last), last)
        return self.queries[last].step + interval - self.step

    @property
    def pending(self) -> Actions:
        """(k, 7) the queued actions up to the next chunk, which an event does not cancel."""
        if not self.queries:
            return np.empty((0, 0))
        number = len(self.queries)
        left = self.queries[-1].step + self.latency_of(number - 1).delay(number - 1) - self.step
        return self._queue()[: left if left > 0 else self.queued + self.latency_of(number).delay(number)]

    @property
    def next_action(self) -> NDArray[np.float64] | None:
        """(7,) the first queued action; None where the robot waits for an answer. A query comes before it."""
        queue = self._queue()
        return queue[0] if len(queue) else None

    def _queue(self) -> Actions:
        """Return the (k, 7) actions that are left of the last chunk whose answer is there."""
        done, number = len(self.executed), len(self.queries) - 1
        waits = self.latency_of(number).runner == "sync"
        # Two answers may be under way where a policy takes over while one is.
        while done < (there := self.queries[number].step + self.latency_of(number).delay(number)):
            if number == 0 or waits:
                return self.queries[number].actions[:0]
            number -= 1
        chunk = self.queries[number]
        # Actions executed since the observation were in the place of the chunk's first ones; waiting is not.
        dropped = there - chunk.step - sum(step.held for step in self.executed[chunk.step : there])
        end = self.interval_of(number) if waits else len(chunk.actions)
        return chunk.actions[dropped + done - there : end]

    @property
    def just_asked(self) -> bool:
        """True if the last thing that happened is a query."""
        return bool(self.queries) and self.queries[-1].step == len(self.executed)

    @property
    def actions(self) -> NDArray[np.float64]:
        """(steps, 7) as the policy returned them."""
        return np.array([step.action for step in self.executed])

    @property
    def end_effector(self) -> Array:
        """(steps, 3) m, world frame, after each step."""
        return np.array([step.end_effector for step in self.executed])

    @property
    def entity(self) -> Array:
        """(steps, 3) m, world frame: the trigger entity after each step."""
        return np.array([step.entity for step in self.executed])

    @property
    def joints(self) -> NDArray[np.float32] | None:
        """(steps, nq) positions of all joints after each step; None where they were not kept."""
        kept = [step.joints for step in self.executed if step.joints is not None]
        return np.array(kept) if kept and len(kept) == self.step else None

    def stepped(self, step: Step, digest: bytes) -> Trajectory:
        """Return the trajectory after one more step, which left the world with this digest."""
        # Written out, as in :meth:`answered`: replace() takes four times as long, and this is every step.
        return Trajectory(
            self.query_interval,
            self.first,
            step.link,
            digest,
            step.distance_m,
            (*self.executed, step),
            self.queries,
            self.firings,
            self.seen,
            self.latency,
            self.handed_over,
        )

    def answered(self, result: QueryResult) -> Trajectory:
        """Return the trajectory after a query, whose first Q actions are queued."""
        return Trajectory(
            self.query_interval,
            self.first,
            self.link,
            self.digest,
            self.distance_m,
            self.executed,
            (*self.queries, result),
            self.firings,
            self.seen,
            self.latency,
            self.handed_over,
        )

    def fired(self, entry: Entry, applied: Applied, digest: bytes) -> Trajectory:
        """Return the trajectory after an entry of the schedule, which left the world with this digest."""
        after = self.altered(digest)
        firing = Firing(entry, self.step, len(self.queries), self.distance_m, self.proof, applied, after.link)
        return replace(after, firings=(*self.firings, firing))

    def altered(self, digest: bytes) -> Trajectory:
        """Return the trajectory with a link for a change of the world, if it has changed."""
        if digest == self.digest:
            return self
        return replace(self, link=event_link(self.link, digest), digest=digest)

    def watched(self, seen: tuple[object, ...]) -> Trajectory:
        """Return the trajectory with other states of the probes."""
        return replace(self, seen=seen)
