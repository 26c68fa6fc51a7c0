"""The executed prefix: the proof that both rollouts share it, and the two ways back to the event.

The proof is a hash chain. Its first link is the digest of the world when the policy takes over; every
executed step adds a link over (previous link, action bytes, digest of the world after the step). Two rollouts
with the same link have executed the same actions and gone through the same states, bit for bit.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import AdapterError, ProtocolError
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.pairing.episode import ask_policy, begin_policy, begin_world, make_query
from pytest_libero_max.policies.check import memory_digest, remembers, restore_memory
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import Array, World, WorldState

PrefixMode = Literal["fork", "replay"]
"""How Dynamic gets to the event: ``fork`` restores the snapshot taken in Base, ``replay`` plays the
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
class BranchPoint:
    """A rollout at the moment an event fires: all that is needed to go on from there.

    Attributes:
        step: Policy steps executed, at least 1.
        distance_m: Distance of the end effector to the trigger entity.
        state: The world.
        digest: Its fingerprint, 32 bytes.
        memory: What the policy's ``snapshot`` returned; None for a policy without one.
        memory_digest: Its fingerprint then; None where it cannot be told.
        pending: (k, 7) queued actions, which an event does not cancel.
        actions: (step, 7) executed so far.
        end_effector: (step, 3) m, world frame, after each step.
        entity: (step, 3) m, world frame: the trigger entity after each step.
        answers: The queries so far.
        asked: The world at the last of them, kept for a policy without a snapshot.
        chain: The step + 1 links of the hash chain.
    """

    step: int
    distance_m: float
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


def return_to(
    branch: BranchPoint,
    case: Case,
    world: World,
    policy: Policy,
    mode: PrefixMode = "fork",
    clock: Clock | None = None,
) -> None:
    """Bring world and policy back to a branch point, and prove it.

    The world is restored from its snapshot (``fork``) or played there from reset (``replay``). A policy with
    ``snapshot`` and ``restore`` gets the memory it had; one without is, by contract, a function of the
    observation and the query. What that is worth is measured: ``replay`` shows it every observation of the
    prefix again, at the same steps, and ``fork`` the last one, and the answers must be the recorded bytes
    (unless its spec says ``repeatable=False``: then they are not compared, and ``fork`` shows nothing). A
    policy whose memory is made of what it has seen is therefore right in ``replay`` without a snapshot.

    Args:
        branch: Where to go; of this case, this scene and this policy.
        case: The case.
        world: A world of its scene; whatever it was doing is given up.
        policy: The policy.
        mode: The way there.
        clock: Adds up wall-clock seconds.

    Raises:
        ProtocolError: Another state was reached, or the policy answers differently this time.
        AdapterError: The policy raised, or its snapshot was no copy.
    """
    clock = Clock() if clock is None else clock
    if memory_digest(branch.memory) != branch.memory_digest:
        raise AdapterError(
            f"{case.item_id}: the memory that policy {policy.spec.name!r} copied at step {branch.step} has "
            "changed since. Let snapshot() return a copy that the policy does not write to, and "
            "restore(memory) copy from it (copy.deepcopy in both)."
        )
    if mode == "replay":
        _replay(branch, case, world, policy, clock)
    else:
        _fork(branch, case, world, policy, clock)
    if remembers(policy):
        restore_memory(policy, branch.memory)


def _fork(branch: BranchPoint, case: Case, world: World, policy: Policy, clock: Clock) -> None:
    if branch.asked is not None and policy.spec.repeatable:
        world.restore(branch.asked)
        begin_policy(case, world, policy, clock)
        _ask_again(branch.answers[-1], case, world, policy, clock)
        world.restore(branch.state)
    else:
        world.restore(branch.state)
        begin_policy(case, world, policy, clock)
    if world.digest() != branch.digest:
        raise ProtocolError(
            f"{case.item_id}: the world restored from the snapshot at step {branch.step} is not the one it "
            "was taken from, so Base and Dynamic would not share their prefix. The snapshots of "
            f"{world.scene!r} leave something out; --libero-max-prefix=replay does without them."
        )


def _replay(branch: BranchPoint, case: Case, world: World, policy: Policy, clock: Clock) -> None:
    begin_world(case, world, clock)
    link = first_link(world.digest())
    _compare(link, branch, 0, case)
    begin_policy(case, world, policy, clock)
    shown = {} if remembers(policy) else {answer.step: answer for answer in branch.answers}
    for step, action in enumerate(branch.actions):
        if step in shown:
            _ask_again(shown[step], case, world, policy, clock)
        world.step(action)
        link = next_link(link, action, world.digest())
        _compare(link, branch, step + 1, case)


def _compare(link: bytes, branch: BranchPoint, step: int, case: Case) -> None:
    if link == branch.chain[step]:
        return
    where = f"after step {step} of {branch.step}" if step else "before the first step"
    raise ProtocolError(
        f"{case.item_id}: the replay of the executed prefix differs from Base {where}, so the pair is not a "
        "measurement. The simulation does not repeat itself on this machine: check that its versions are the "
        "locked ones, and that nothing else writes to the world."
    )


def _ask_again(answer: Answer, case: Case, world: World, policy: Policy, clock: Clock) -> None:
    actions = ask_policy(world, policy, make_query(case, world, answer.index, answer.step), clock)
    if policy.spec.repeatable and actions.tobytes() != answer.actions.tobytes():
        raise ProtocolError(
            f"{case.item_id}: policy {policy.spec.name!r} answered query {answer.index} at step "
            f"{answer.step} differently when it was shown the same observation again. Draw from query.seed "
            "and from nothing else; give a policy with memory snapshot() and restore(memory), or play with "
            "--libero-max-prefix=replay; declare PolicySpec(repeatable=False) only for a server whose "
            "arithmetic varies."
        )
