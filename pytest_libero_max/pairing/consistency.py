"""The same query asked twice: a check that answers depend only on inputs that the contract allows.

A policy answers from the observation, the query and, if it offers ``snapshot`` and ``restore``, the memory
that they carry. So the same observation and query, with the memory it had, must give the same bytes again.
"""

from __future__ import annotations

from dataclasses import dataclass

from pytest_libero_max.benchmark.documents import canonical_digest
from pytest_libero_max.errors import ProtocolError, RefusalError
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.pairing.trajectory import QueryResult
from pytest_libero_max.policies.check import copy_memory, memory_digest, remembers, restore_memory
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.worlds.contract import WorldState

SAMPLE_INTERVAL = 4
"""One query of this many is kept where arms cannot part any more; the last one kept is asked again at the end
of the arm. Which one differs from case to case."""


def is_sampled(index: int, case_id: str) -> bool:
    """Return True if a query is one of those that are kept in a case."""
    return index % SAMPLE_INTERVAL == int(canonical_digest(case_id), 16) % SAMPLE_INTERVAL


@dataclass(frozen=True)
class Memory:
    """A copy of a policy's memory, as its ``snapshot`` returned it."""

    value: object
    """The copy; None for a policy without one."""
    digest: bytes | None
    """Its fingerprint then; None where it cannot be computed."""

    @classmethod
    def of(cls, policy: Policy) -> Memory:
        """Return a copy of the policy's present memory, or raise AdapterError."""
        value = copy_memory(policy)
        return cls(value, memory_digest(value))

    def restore(self, stage: Stage, step: int) -> None:
        """Give the policy the memory back, if it has any, or raise RefusalError or AdapterError."""
        if remembers(stage.policy):
            self.require_unchanged(stage, step)
            restore_memory(stage.policy, self.value)

    def require_unchanged(self, stage: Stage, step: int) -> None:
        """Check that the copy is unchanged, or raise RefusalError."""
        if memory_digest(self.value) != self.digest:
            raise RefusalError(
                f"{stage.case.item_id}: the memory that policy {stage.spec.name!r} copied at step {step} has "
                "changed since. Let snapshot() return a copy that the policy does not write to, and "
                "restore(memory) copy from it (copy.deepcopy in both)."
            )


@dataclass(frozen=True)
class RecordedQuery:
    """A query's result with all that is needed to ask for it again."""

    result: QueryResult
    state: WorldState
    """The world at the query."""
    digest: bytes
    """Its fingerprint, 32 bytes."""
    memory: Memory | None
    """The policy's memory before the query; None for the first query, before which it has none."""

    def ask_again(self, stage: Stage) -> None:
        """Bring world and policy to the query, ask, and compare; both are left there.

        Raises:
            ProtocolError: The world's snapshot leaves something out.
            RefusalError: The policy answers differently, or its copies are none.
        """
        stage.world.restore(self.state)
        if stage.world.digest() != self.digest:
            raise restored_elsewhere(stage, self.result.step)
        stage.begin_policy()
        self.ask_again_here(stage)

    def ask_again_here(self, stage: Stage) -> None:
        """Ask and compare where the world is at the query and the policy has begun; see :meth:`ask_again`."""
        if self.memory is None or not remembers(stage.policy):
            require_same_answer(self.result, stage)
            return
        # A copy that has no fingerprint is used twice, so that one which is written to is found as well.
        for _ in range(1 if self.memory.digest else 2):
            self.memory.restore(stage, self.result.step)
            require_same_answer(self.result, stage)
        self.memory.require_unchanged(stage, self.result.step)


def require_same_answer(result: QueryResult, stage: Stage) -> None:
    """Ask a query again, in the world as it is, and compare the bytes, or raise RefusalError."""
    with stage.clock("asked_again_s"):
        again = stage.ask(stage.query(result.index, result.step, result.reseeds))
    if not stage.spec.repeatable or again.actions.tobytes() == result.actions.tobytes():
        return
    where = (
        f"{stage.case.item_id}: policy {stage.spec.name!r} answered query {result.index} at step "
        f"{result.step} differently when it was shown the same observation again"
    )
    if remembers(stage.policy):
        raise RefusalError(
            f"{where}, with the memory that it had before. Let snapshot() copy all that answers depend "
            "on (copy.deepcopy), and restore(memory) bring all of it back; draw from query.seed and from "
            "nothing else."
        )
    raise RefusalError(
        f"{where}. Draw from query.seed and from nothing else; give a policy with memory snapshot() and "
        "restore(memory), or declare PolicySpec(history=True); declare PolicySpec(repeatable=False) only "
        "for a server whose arithmetic varies."
    )


def restored_elsewhere(stage: Stage, step: int) -> ProtocolError:
    """Error of a world whose snapshot does not bring it back."""
    return ProtocolError(
        f"{stage.case.item_id}: the world restored from the snapshot at step {step} is not the one it was "
        f"taken from, so the arms would not share their prefix. The snapshots of {stage.world.scene!r} leave "
        "something out; --libero-max-prefix=replay does without them."
    )
