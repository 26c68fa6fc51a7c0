"""The executed prefix: the proof that two arms share it, and the two ways back to where they part.

The proof is a hash chain. Its first link is the digest of the world after the settle steps; every executed
step adds a link over (previous link, action bytes, digest of the world after the step), every change one over
(previous link, digest of the world after the change). Two rollouts with the same link have executed the same
actions and gone through the same states, bit for bit.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.events.schedules import Entry
from pytest_libero_max.pairing.consistency import Asked, Memory, require_same_answer, restored_elsewhere
from pytest_libero_max.pairing.stage import Answer, Applied, Stage
from pytest_libero_max.policies.check import memory_of, remembers, sees
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import Array, WorldState

PrefixMode = Literal["fork", "replay"]
"""How an arm gets to the branch point: ``fork`` restores the snapshot taken there, ``replay`` plays the
recorded actions from reset."""


@dataclass(frozen=True)
class Firing:
    """An entry of a schedule that has happened.

    Attributes:
        entry: Which.
        step: Policy steps executed before it.
        queries: Policy queries before it.
        distance_m: Distance of the end effector to the case's trigger entity then.
        proof: Last link of the hash chain before it, hexadecimal.
        applied: What it did; the change is the one that was made, also for a reversal.
    """

    entry: Entry
    step: int
    queries: int
    distance_m: float
    proof: str
    applied: Applied


@dataclass(frozen=True)
class BranchPoint:
    """A rollout between two steps: all that is needed to go on from there.

    Attributes:
        step: Policy steps executed. At 0 the policy has not begun.
        distance_m: Distance of the end effector to the trigger entity.
        min_distance_m: The smallest of them so far; infinite before the first step.
        state: The world.
        digest: Its fingerprint, 32 bytes.
        memory: What the policy remembers; None at step 0.
        pending: (k, 7) queued actions, which an event does not cancel.
        actions: (step, 7) executed so far.
        end_effector: (step, 3) m, world frame, after each step.
        entity: (step, 3) m, world frame: the trigger entity after each step.
        answers: The queries so far.
        asked: The last of them, to be asked again; None where there is none, or the policy does not repeat
            itself.
        firings: The entries of the schedule that have happened.
        chain: The links of the hash chain: the first, one for each step, one for each change.
    """

    step: int
    distance_m: float
    min_distance_m: float
    state: WorldState
    digest: bytes
    memory: Memory | None
    pending: NDArray[np.float64]
    actions: NDArray[np.float64]
    end_effector: Array
    entity: Array
    answers: tuple[Answer, ...]
    asked: Asked | None
    firings: tuple[Firing, ...]
    chain: tuple[bytes, ...]

    @property
    def proof(self) -> str:
        """The last link, hexadecimal."""
        return self.chain[-1].hex()


def first_link(digest: bytes) -> bytes:
    """The chain's beginning: 32 bytes over the world's digest when the policy takes over."""
    return hashlib.sha256(b"libero-max-chain" + digest).digest()


def next_link(link: bytes, action: NDArray[np.float64], digest: bytes) -> bytes:
    """The link after one more step: 32 bytes over the last one, the (7,) action and the world's digest."""
    return hashlib.sha256(link + action.tobytes() + digest).digest()


def event_link(link: bytes, digest: bytes) -> bytes:
    """The link after an event: 32 bytes over the previous one and the world's digest right after it."""
    return hashlib.sha256(link + b"event" + digest).digest()


def way_back(policy: Policy, mode: PrefixMode) -> PrefixMode:
    """The way in which a policy is brought back: one that cannot copy what it remembers is shown it again."""
    return "replay" if memory_of(policy) in ("queries", "frames") else mode


def return_to_branch(branch: BranchPoint, stage: Stage, mode: PrefixMode = "fork") -> None:
    """Bring world and policy back to a branch point, and prove it.

    The world is restored from its snapshot (``fork``) or played there from reset (``replay``). A policy with
    ``snapshot`` and ``restore`` gets the memory it had; one without is, by contract, a function of the
    observation and the query. What both are worth is measured (unless the spec says ``repeatable=False``):
    the policy is asked the last query of the prefix again, with the memory it had then, and the answer must
    be the recorded bytes. In ``replay`` it is asked every query of the prefix again, at the same steps, and
    shown every step if it is one that sees them, so a policy whose memory is made of what it has seen is
    right there without ``snapshot``. One that declares such a memory is brought back like that in any mode.

    Args:
        branch: Where to go.
        stage: With what: of the branch's case, scene and policy. Whatever they were doing is given up.
        mode: The way there.

    Raises:
        ProtocolError: Another state was reached, or the policy answers differently this time.
        AdapterError: The policy raised, its snapshot was no copy, or it answers differently with the memory
            that it had.
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
    if branch.asked is not None:
        branch.asked.ask_again(stage)
        world.restore(branch.state)
    else:
        world.restore(branch.state)
        if branch.step:
            stage.begin_policy()
    if world.digest() != branch.digest:
        raise restored_elsewhere(stage, branch.step)


def _replay(branch: BranchPoint, stage: Stage) -> None:
    world = stage.world
    stage.begin_world()
    digest = world.digest()
    links = [first_link(digest)]
    _compare(links, branch, 0, stage)
    remembering = remembers(stage.policy)
    # Where answers are not compared, a policy without a snapshot still has to see what it saw.
    show = stage.spec.repeatable or not remembering
    shown = {answer.step: answer for answer in branch.answers} if show else {}
    for step in range(branch.step + 1):
        for firing in (firing for firing in branch.firings if firing.step == step):
            firing.applied.change.apply(world)
            digest, before = world.digest(), digest
            if digest != before:
                links.append(event_link(links[-1], digest))
                _compare(links, branch, step, stage)
        if step == branch.step:
            return
        if step == 0:
            stage.begin_policy()
        if step in shown:
            require_same_answer(shown[step], stage)
        elif show and sees(stage.policy):
            stage.show(step)
        # The first query, before which there is no memory, has just been asked again.
        asked = branch.asked
        if asked is not None and asked.memory is not None and remembering and asked.answer.step == step:
            asked.ask_again_here(stage)
        stage.watch.step()
        world.step(branch.actions[step])
        digest = world.digest()
        links.append(next_link(links[-1], branch.actions[step], digest))
        _compare(links, branch, step + 1, stage)


def _compare(links: list[bytes], branch: BranchPoint, step: int, stage: Stage) -> None:
    if links[-1] == branch.chain[len(links) - 1]:
        return
    where = f"after step {step} of {branch.step}" if step else "before the first step"
    raise ProtocolError(
        f"{stage.case.item_id}: the replay of the executed prefix differs {where} from what was played "
        "first, so the arms are not comparable. The simulation does not repeat itself on this machine: check "
        "that its versions are the locked ones, and that nothing else writes to the world."
    )
