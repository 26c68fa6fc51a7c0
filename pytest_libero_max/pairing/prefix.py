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

from pytest_libero_max.errors import AdapterError, ProtocolError
from pytest_libero_max.events.schedules import Entry
from pytest_libero_max.pairing.stage import Applied, Stage
from pytest_libero_max.policies.check import memory_digest, remembers, restore_memory
from pytest_libero_max.worlds.contract import Array, WorldState

PrefixMode = Literal["fork", "replay"]
"""How an arm gets to the branch point: ``fork`` restores the snapshot taken there, ``replay`` plays the
recorded actions from reset."""


@dataclass(frozen=True)
class Answer:
    """One query of a rollout and all that it returned, executed or not.

    Attributes:
        index: Number of the query in the episode, from 0.
        step: Policy steps executed before it.
        actions: (n, 7), Q <= n <= H.
    """

    index: int
    step: int
    actions: NDArray[np.float64]


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
        memory: What the policy's ``snapshot`` returned; None for a policy without one, and at step 0.
        memory_digest: Its fingerprint then; None where it cannot be told.
        pending: (k, 7) queued actions, which an event does not cancel.
        actions: (step, 7) executed so far.
        end_effector: (step, 3) m, world frame, after each step.
        entity: (step, 3) m, world frame: the trigger entity after each step.
        answers: The queries so far.
        asked: The world at the last of them, kept for a policy without a snapshot.
        firings: The entries of the schedule that have happened.
        chain: The links of the hash chain: the first, one for each step, one for each change.
    """

    step: int
    distance_m: float
    min_distance_m: float
    state: WorldState
    digest: bytes
    memory: object
    memory_digest: bytes | None
    pending: NDArray[np.float64]
    actions: NDArray[np.float64]
    end_effector: Array
    entity: Array
    answers: tuple[Answer, ...]
    asked: WorldState | None
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


def return_to_branch(branch: BranchPoint, stage: Stage, mode: PrefixMode = "fork") -> None:
    """Bring world and policy back to a branch point, and prove it.

    The world is restored from its snapshot (``fork``) or played there from reset (``replay``). A policy with
    ``snapshot`` and ``restore`` gets the memory it had; one without is, by contract, a function of the
    observation and the query. What that is worth is measured: ``replay`` shows it every observation of the
    prefix again, at the same steps, and ``fork`` the last one, and the answers must be the recorded bytes
    (unless its spec says ``repeatable=False``: then they are not compared, and ``fork`` shows nothing). A
    policy whose memory is made of what it has seen is therefore right in ``replay`` without a snapshot.

    Args:
        branch: Where to go.
        stage: With what: of the branch's case, scene and policy. Whatever they were doing is given up.
        mode: The way there.

    Raises:
        ProtocolError: Another state was reached, or the policy answers differently this time.
        AdapterError: The policy raised, or its snapshot was no copy.
    """
    if memory_digest(branch.memory) != branch.memory_digest:
        raise AdapterError(
            f"{stage.case.item_id}: the memory that policy {stage.policy.spec.name!r} copied at step "
            f"{branch.step} has changed since. Let snapshot() return a copy that the policy does not write "
            "to, and restore(memory) copy from it (copy.deepcopy in both)."
        )
    if mode == "replay":
        _replay(branch, stage)
    else:
        _fork(branch, stage)
    if remembers(stage.policy) and branch.step:
        restore_memory(stage.policy, branch.memory)


def _fork(branch: BranchPoint, stage: Stage) -> None:
    world = stage.world
    if branch.asked is not None and stage.policy.spec.repeatable:
        world.restore(branch.asked)
        stage.begin_policy()
        _ask_again(branch.answers[-1], stage)
        world.restore(branch.state)
    else:
        world.restore(branch.state)
        if branch.step:
            stage.begin_policy()
    if world.digest() != branch.digest:
        raise ProtocolError(
            f"{stage.case.item_id}: the world restored from the snapshot at step {branch.step} is not the "
            "one it was taken from, so the arms would not share their prefix. The snapshots of "
            f"{world.scene!r} leave something out; --libero-max-prefix=replay does without them."
        )


def _replay(branch: BranchPoint, stage: Stage) -> None:
    world = stage.world
    stage.begin_world()
    digest = world.digest()
    links = [first_link(digest)]
    _compare(links, branch, 0, stage)
    shown = {} if remembers(stage.policy) else {answer.step: answer for answer in branch.answers}
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
            _ask_again(shown[step], stage)
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


def _ask_again(answer: Answer, stage: Stage) -> None:
    spec = stage.policy.spec
    actions = stage.ask(stage.query(answer.index, answer.step))
    if spec.repeatable and actions.tobytes() != answer.actions.tobytes():
        raise ProtocolError(
            f"{stage.case.item_id}: policy {spec.name!r} answered query {answer.index} at step "
            f"{answer.step} differently when it was shown the same observation again. Draw from query.seed "
            "and from nothing else; give a policy with memory snapshot() and restore(memory), or play with "
            "--libero-max-prefix=replay; declare PolicySpec(repeatable=False) only for a server whose "
            "arithmetic varies."
        )
