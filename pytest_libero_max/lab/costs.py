"""Expected costs of pairs, from the timings of pairs that were measured.

Time is the product of counts (steps, calls of the policy) and the time of one of them. The counts depend on
the task and the policy: a task that the policy solves ends early. The time of one depends on the scene, and
is learnt by suite.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from typing import NamedTuple

from pytest_libero_max.benchmark.cases import step_budget
from pytest_libero_max.benchmark.suites import longest_budget
from pytest_libero_max.evaluation.player import PAIR, WORLD
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.plan import PlannedPair

_DONORS = 3
"""Least size of a group to draw from; a smaller one leaves that to the larger group that it is in."""


class Kind(NamedTuple):
    """Properties of a pair from which its cost is expected."""

    suite: str
    task: str
    event: str

    @classmethod
    def of(cls, pair: PlannedPair) -> Kind:
        return cls(pair.suite, pair.task, pair.event)

    def groups(self) -> Iterator[tuple[str, ...]]:
        """Return groups that the kind belongs to: all pairs, its suite, its task, the kind itself."""
        return (tuple(self[:length]) for length in range(4))


class Counted(NamedTuple):
    """Work of a pair: control steps, and calls of the policy with an observation each."""

    steps: float
    calls: float


class Cost(NamedTuple):
    """Cost of a pair."""

    worker_s: float
    """Seconds of its worker apart from the policy: scene, steps, images, checks."""
    calls: float
    """Calls of the policy."""
    policy_s: float
    """Seconds of these calls, as they were measured."""

    @property
    def seconds(self) -> float:
        """From the beginning to the end of the pair."""
        return self.worker_s + self.policy_s


def counted(record: PairRecord) -> Counted:
    """Return the steps and calls of a measured pair; a part that arms share is counted once.

    Where the policy is asked again for a check, those calls are counted as well.
    """
    steps = calls = 0
    for arm in record.arms.values():
        if arm.shares is None:  # another arm has played what came before its event
            first = arm.firings[0] if arm.firings else None
            steps += arm.steps - (first.step if first else 0)
            calls += arm.queries - (first.queries if first else 0)
    if record.triggered and "asked_again_s" in record.timings:
        calls += 2
    return Counted(steps, calls)


def seconds_of(record: PairRecord) -> float:
    """Return the seconds of a pair; without those of its scene where the record does not have them."""
    timings = record.timings
    if PAIR in timings:
        return float(timings[PAIR])
    parts = ("reset_s", "prefix_s", "asked_again_s")
    arms = (f"arm_{name}_s" for name in record.arms)
    return float(sum(timings.get(name, 0.0) for name in (*parts, *arms)))


@dataclass
class _Units:
    """Sums over pairs, from which the time of one step or call follows."""

    pairs: int = 0
    steps: float = 0.0
    calls: float = 0.0
    fixed_s: float = 0.0
    steps_s: float = 0.0
    images_s: float = 0.0
    policy_s: float = 0.0

    def add(self, record: PairRecord) -> None:
        done, timings = counted(record), record.timings
        fixed = timings.get("reset_s", 0.0) + timings.get(WORLD, 0.0)
        images, policy = timings.get("observe_s", 0.0), timings.get("policy_s", 0.0)
        self.pairs += 1
        self.steps += done.steps
        self.calls += done.calls
        self.fixed_s += fixed
        self.images_s += images
        self.policy_s += policy
        self.steps_s += max(seconds_of(record) - fixed - images - policy, 0.0)

    def cost(self, done: Counted) -> Cost:
        worker_s = self.fixed_s / self.pairs + done.steps * self.steps_s / max(self.steps, 1.0)
        worker_s += done.calls * self.images_s / max(self.calls, 1.0)
        return Cost(worker_s, done.calls, done.calls * self.policy_s / max(self.calls, 1.0))


@dataclass
class CostModel:
    """Learns the costs of pairs from measured ones.

    Counts are kept in units of the suite's budget of steps.
    """

    _own: dict[str, Counted] = field(default_factory=dict)
    _groups: dict[tuple[str, ...], list[Counted]] = field(default_factory=dict)
    _units: dict[tuple[str, ...], _Units] = field(default_factory=dict)

    def add(self, kind: Kind, record: PairRecord) -> None:
        """Learn from a measured pair."""
        done, budget = counted(record), _budget(kind)
        self._own[record.case_id] = done
        for group in kind.groups():
            share = Counted(done.steps / budget, done.calls / budget)
            self._groups.setdefault(group, []).append(share)
        for group in ((), (kind.suite,)):
            self._units.setdefault(group, _Units()).add(record)

    def drawn(self, kind: Kind, case_id: str) -> Cost:
        """Return the cost of one pair, from its own counts, or from those of a measured pair of its kind.

        That is one of the smallest group that has several, chosen by the id of the case: the same one
        whenever it is asked. So a plan has long pairs and short ones, as runs have.
        """
        units = self._units.get((kind.suite,)) or self._units[()]
        if case_id in self._own:
            return units.cost(self._own[case_id])
        donors = self._groups[()]
        for group in kind.groups():
            if len(known := self._groups.get(group, [])) >= _DONORS:
                donors = known
        number = int.from_bytes(sha256(case_id.encode()).digest()[:8]) % len(donors)
        share, budget = donors[number], _budget(kind)
        return units.cost(Counted(share.steps * budget, share.calls * budget))


def _budget(kind: Kind) -> int:
    """Policy steps that an episode may take."""
    return step_budget(kind.suite) or longest_budget()
