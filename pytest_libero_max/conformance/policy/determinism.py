"""Rules for repetition and memory: a query gets the same answer again, an episode forgets the one before."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.conformance.fresh_process import result_elsewhere
from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.subject import QUERIES, PolicySubject, open_policy
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.policies.check import (
    Actions,
    ask_together,
    batches,
    copy_memory,
    memory_of,
    remembers,
    restore_memory,
)
from pytest_libero_max.policies.clients.address import is_address

MIXED_UP = 0.05
"""Largest difference between answers in a batch and alone that can be rounding."""

FRESH_S = 300.0
"""Longest time of the fresh process, s: it loads the policy and asks it :data:`.QUERIES` queries."""


def not_repeatable(subject: PolicySubject) -> Finding | None:
    """Return the finding of rules that compare two answers, for a policy whose answers do not repeat."""
    if subject.policy.spec.repeatable:
        return None
    return unexamined("repeatable=False, so no two answers can be compared")


def _twice(subject: PolicySubject) -> tuple[Actions, Actions]:
    answers = []
    for _ in range(2):
        subject.start()
        answers.append(subject.ask(0))
    return answers[0], answers[1]


@rule("policy/determinism/query", "must", needs=ANSWERS)
def same_query(subject: PolicySubject) -> Finding:
    """Answer the same query with the same bytes."""
    if reason := not_repeatable(subject):
        return reason
    first, second = _twice(subject)
    if first.tobytes() != second.tobytes():
        return broken(
            "the same first query of an episode got two different answers",
            "the same bytes",
            "It draws from something else than query.seed, or reset() leaves something behind. A server "
            "that cannot be seeded declares repeatable=False.",
        )
    subject.start()
    another = subject.ask(0, seed=subject.shown.query(0).seed ^ 0x5A5A)
    if first.tobytes() == another.tobytes():
        return kept("deterministic: the same answer with another seed as well")
    return kept("the same query gets the same answer, another seed another one")


@rule("policy/determinism/declared", "note", needs=ANSWERS)
def repeatable(subject: PolicySubject) -> Finding:
    """Repeat an answer, and declare that it repeats."""
    if subject.policy.spec.repeatable:
        return kept("repeatable=True is declared")
    first, second = _twice(subject)
    if first.tobytes() != second.tobytes():
        return broken(
            "the same query got two different answers, and repeatable=False says so",
            "answers that repeat themselves",
            "Measure how often Base flips by itself: --libero-max-noise=floor:16.",
        )
    return broken(
        "repeatable=False is declared, but the answer repeated itself",
        "what is so, declared",
        "If the server is deterministic, repeatable=True lets every pair check it.",
    )


def _alone_and_batched(
    subject: PolicySubject,
) -> Finding | tuple[list[Actions], list[list[Actions]]]:
    """Return the answers alone, and in batches of the same size: in order, reversed, and each with itself.

    A finding where the rules for batches cannot be examined.
    """
    policy = subject.policy
    if not batches(policy):
        return kept("the policy answers one query at a time")
    if remembers(policy):
        return unexamined("a policy with memory is not asked in batches")
    if reason := not_repeatable(subject):
        return reason
    alone = []
    for index in range(QUERIES):
        subject.start()
        alone.append(subject.ask(index))
    items = [subject.item(index) for index in range(QUERIES)]
    together = ask_together(policy, items)
    reversed_order = ask_together(policy, items[::-1])[::-1]
    with_itself = [ask_together(policy, [item] * QUERIES)[0] for item in items]
    return alone, [together, reversed_order, with_itself]


@rule("policy/determinism/company", "must", needs=ANSWERS)
def company(subject: PolicySubject) -> Finding:
    """Answer each query of a batch as if it were alone, in the order of the items."""
    answers = subject.once(_alone_and_batched)
    if isinstance(answers, Finding):
        return answers
    alone, batched = answers
    pairs = [pair for batch in batched[:2] for pair in zip(alone, batch, strict=True)]
    if any(a.shape != b.shape or np.abs(a - b).max() > MIXED_UP for a, b in pairs):
        return broken(
            "predict_batch gives other answers than predict",
            "the answer that each query gets alone, in the order of the items",
            "The items are mixed up, or something is shared among them.",
        )
    return kept("predict_batch gives the answers of predict, but for rounding")


@rule("policy/determinism/rounding", "note", needs="policy/determinism/company")
def rounding(subject: PolicySubject) -> Finding:
    """Answer with the same bytes alone and in a batch."""
    answers = subject.once(_alone_and_batched)
    if isinstance(answers, Finding):
        return answers
    alone, batched = answers
    pairs = [pair for batch in batched[:2] for pair in zip(alone, batch, strict=True)]
    if all(a.tobytes() == b.tobytes() for a, b in pairs):
        return kept("the same bytes alone and in a batch")
    furthest = max(float(np.abs(a - b).max()) for a, b in pairs)
    if all(len({answer.tobytes() for answer in same}) == 1 for same in zip(*batched, strict=True)):
        observed = f"answers change by up to {furthest:.1g} with the size of the batch alone"
        cure = "Serve it with --pad-batch to get the same bytes whoever else asks."
    else:
        observed = (
            f"answers change by up to {furthest:.1g} with the other queries of the batch, "
            "also at the same size"
        )
        cure = "Serve it without --max-batch, or declare repeatable=False."
    return broken(observed, "the same bytes alone and in a batch", cure)


@rule("policy/determinism/process", "must", needs="policy/determinism/query")
def fresh_process(subject: PolicySubject) -> Finding:
    """Answer with the same bytes in a fresh process with an empty home."""
    reference = subject.loading.get("reference")
    if reference is None:
        return unexamined("the policy is an object of this process")
    if is_address(reference):
        return unexamined("the policy is behind a server, a process of its own")
    if reason := not_repeatable(subject):
        return reason
    here = [answer.tolist() for answer in subject.first.answers]
    there = _answers_elsewhere(subject)
    if isinstance(there, Finding):
        return there
    if there == here:
        return kept("the same bytes in a fresh process with an empty home")
    first = next(index for index in range(QUERIES) if there[index] != here[index])
    return broken(
        f"query {first} of an episode got another answer in a fresh process with an empty home",
        "the same bytes",
        "It reads something that another process does not have: files in the home or working folder, "
        "a hash that PYTHONHASHSEED changes, the time, or a generator without a seed.",
    )


def first_answers(loading: str) -> list[Any]:
    """Return the first answers of a policy, given the arguments of :func:`.open_policy` as JSON."""
    return [answer.tolist() for answer in open_policy(**json.loads(loading)).first.answers]


def _answers_elsewhere(subject: PolicySubject) -> Any | Finding:
    """Return the answers to the first queries from a new process, in a place without old files."""
    from pytest_libero_max.policies.references import absolute_reference

    loading = {**subject.loading}
    loading["reference"] = absolute_reference(loading["reference"], Path.cwd())
    if loading["profile"] is not None and Path(loading["profile"]).is_file():
        loading["profile"] = str(Path(loading["profile"]).absolute())
    return result_elsewhere(
        first_answers,
        json.dumps(loading),
        FRESH_S,
        expected="the same bytes",
        cure="The policy needs something of this process or its home: name it where the policy is loaded.",
    )


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
