"""Rules for what a policy keeps from one query, and one episode, to the next."""

from __future__ import annotations

from dataclasses import replace

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.determinism import not_repeatable
from pytest_libero_max.conformance.policy.subject import QUERIES, PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule
from pytest_libero_max.policies.check import copy_memory, memory_of, remembers, restore_memory


@rule("policy/memory/reset", "must", needs=ANSWERS)
def forgets(subject: PolicySubject) -> Finding:
    """Forget everything at the beginning of an episode."""
    if reason := not_repeatable(subject):
        return reason
    subject.start()
    fresh = subject.ask(0)
    for index in range(1, QUERIES):
        subject.ask(index)
    episode = subject.shown.episode
    subject.start(replace(episode, task_index=episode.task_index + 1, seed=episode.seed + 1))
    subject.ask(0)
    subject.start()
    if subject.ask(0).tobytes() == fresh.tobytes():
        return kept("a new episode forgets everything")
    return broken(
        "the first answer of an episode depends on the episodes before",
        "a new episode forgets everything",
        "Let reset() empty queues, histories, counters and generators.",
    )


@rule("policy/memory/declared", "must", needs=ANSWERS)
def declared(subject: PolicySubject) -> Finding:
    """Have no memory, or offer snapshot() and restore(memory)."""
    if reason := not_repeatable(subject):
        return reason
    subject.start()
    subject.ask(0)
    after = subject.ask(1)
    subject.start()
    alone = subject.ask(1)
    if after.tobytes() == alone.tobytes():
        return kept("an answer depends on its own observation and query alone")
    if remembers(subject.policy):
        return kept("answers depend on earlier queries, and snapshot() is offered")
    if memory_of(subject.policy) != "none":
        return kept("answers depend on earlier queries, as the policy declares")
    return broken(
        "an answer depends on the queries before it",
        "no memory, or snapshot() and restore(memory)",
        "A queue, a history or a generator lives on between queries: empty it, or offer both methods.",
    )


@rule("policy/memory/snapshot", "must", needs=ANSWERS)
def snapshot(subject: PolicySubject) -> Finding:
    """Bring back the memory that was copied."""
    policy = subject.policy
    if not remembers(policy):
        return kept("the policy offers no snapshot()")
    if reason := not_repeatable(subject):
        return reason
    subject.start()
    subject.ask(0)
    memory = copy_memory(policy)
    first = subject.ask(1)
    subject.ask(2)
    for _ in range(2):
        restore_memory(policy, memory)
        if subject.ask(1).tobytes() != first.tobytes():
            return broken(
                "after restore(), the same query got another answer",
                "the memory that snapshot() copied",
                "Let snapshot() copy all that answers depend on (copy.deepcopy), and restore() copy from it.",
            )
    return kept("restore() brings back what snapshot() copied")
