"""The executed prefix: the point at which arms part, and the two ways back to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.pairing.consistency import (
    Memory,
    RecordedQuery,
    require_same_answer,
    restored_elsewhere,
)
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.pairing.trajectory import (
    HandedOver,
    Trajectory,
    event_link,
    first_link,
    next_link,
)
from pytest_libero_max.policies.check import Actions, memory_of, remembers, sees
from pytest_libero_max.policies.contract import Handover, Policy
from pytest_libero_max.worlds.contract import WorldState, alterable

PrefixMode = Literal["fork", "replay"]
"""Way of an arm to the branch point: ``fork`` restores the snapshot taken there, ``replay`` plays the
recorded actions from reset."""


@dataclass(frozen=True)
class BranchPoint:
    """A rollout between two steps: all that is needed to go on from there."""

    trajectory: Trajectory
    state: WorldState
    memory: Memory | None
    """The policy's memory; None at step 0, where it has not begun."""
    recorded: RecordedQuery | None
    """The last query, to be asked again; None where there is none, or the policy does not repeat itself."""

    @property
    def step(self) -> int:
        """Number of policy steps executed. At 0 the policy has not begun."""
        return self.trajectory.step

    @property
    def digest(self) -> bytes:
        """Fingerprint of the world, 32 bytes."""
        return self.trajectory.digest

    def handed_to(self, query_interval: int, at_once: bool = False) -> BranchPoint:
        """Return the point as another policy goes on from it, whose queries are still to come.

        Args:
            query_interval: Q of that policy.
            at_once: True if it is asked here, whatever is queued.
        """
        trajectory = self.trajectory
        over = HandedOver(len(trajectory.queries), query_interval, at_once)
        return replace(self, trajectory=replace(trajectory, handed_over=over), memory=None, recorded=None)

    def handover_of(self, policy: str) -> Handover | None:
        """Return what a policy that takes over is given of the rollout so far; None at its beginning."""
        if not self.step:
            return None
        executed, remaining = self.trajectory.actions, self.trajectory.pending.copy()
        executed.setflags(write=False)
        remaining.setflags(write=False)
        return Handover(policy, self.step, executed, remaining)

    @property
    def pending(self) -> Actions:
        """(k, 7) queued actions, which an event does not cancel."""
        return self.trajectory.pending

    @property
    def proof(self) -> str:
        """The last link of the hash chain, hexadecimal."""
        return self.trajectory.proof


def way_back(policy: Policy, mode: PrefixMode) -> PrefixMode:
    """Mode in which a policy is brought back: one that cannot copy what it remembers is shown it again."""
    return "replay" if memory_of(policy) in ("queries", "frames") else mode


def return_to_branch(branch: BranchPoint, stage: Stage, mode: PrefixMode = "fork") -> None:
    """Bring world and policy back to a branch point, and prove it.

    The world is restored from its snapshot (``fork``) or played there from reset (``replay``). A policy with
    ``snapshot`` and ``restore`` gets the memory it had; one without is, by contract, a function of the
    observation and the query. Both are checked (unless the spec says ``repeatable=False``):
    the policy is asked the last query of the prefix again, with the memory it had then, and the answer must
    be the recorded bytes. In ``replay`` it is asked every query of the prefix again, at the same steps, and
    shown every step if it is one that sees them, so a policy whose memory is made of what it has seen is
    right there without ``snapshot``. One that declares such a memory is brought back like that in any mode.

    Args:
        stage: A stage of the branch's case, scene and policy. Whatever they were doing is given up.

    Raises:
        ProtocolError: Another state was reached.
        RefusalError: The policy answers differently this time, or its snapshot was no copy.
        AdapterError: The policy raised.
    """
    if branch.memory is not None:
        branch.memory.require_unchanged(stage, branch.step)
    if way_back(stage.policy, mode) == "replay":
        _replay(branch, stage)
    else:
        _fork(branch, stage)
    if branch.memory is not None:
        branch.memory.restore(stage, branch.step)


def _fork(branch: BranchPoint, stage: Stage) -> None:
    world = stage.world
    if branch.recorded is not None:
        branch.recorded.ask_again(stage)
        world.restore(branch.state)
    else:
        world.restore(branch.state)
        if branch.step:
            stage.begin_policy()
    if world.digest() != branch.digest:
        raise restored_elsewhere(stage, branch.step)


def _replay(branch: BranchPoint, stage: Stage) -> None:
    world, played = stage.world, branch.trajectory
    stage.begin_world()
    digest = world.digest()
    link = first_link(digest)
    _compare(link, played.first, branch, 0, stage)
    remembering = remembers(stage.policy)
    recorded = branch.recorded if remembering else None
    # Where answers are not compared, a policy without a snapshot still has to see what it saw.
    show = stage.spec.repeatable or not remembering
    shown = {result.step: result for result in played.queries} if show else {}
    for step in range(branch.step + 1):
        for firing in (firing for firing in played.firings if firing.step == step):
            firing.applied.change.apply(alterable(world))
            digest, before = world.digest(), digest
            link = link if digest == before else event_link(link, digest)
            _compare(link, firing.link, branch, step, stage)
        if step == branch.step:
            return
        if step == 0:
            stage.begin_policy()
        if step in shown:
            require_same_answer(shown[step], stage)
        elif show and sees(stage.policy):
            stage.show(step)
        # The first query, before which there is no memory, has just been asked again.
        if recorded is not None and recorded.memory is not None and recorded.result.step == step:
            recorded.ask_again_here(stage)
        stage.watch.step()
        executed = played.executed[step]
        world.step(executed.action)
        digest = world.digest()
        link = next_link(link, executed.action, digest)
        _compare(link, executed.link, branch, step + 1, stage)


def _compare(link: bytes, recorded: bytes, branch: BranchPoint, step: int, stage: Stage) -> None:
    if link == recorded:
        return
    where = f"after step {step} of {branch.step}" if step else "before the first step"
    raise ProtocolError(
        f"{stage.case.item_id}: the replay of the executed prefix differs {where} from what was played "
        "first, so the arms are not comparable. The simulation does not repeat itself on this machine: check "
        "that its versions are the locked ones, and that nothing else writes to the world."
    )
