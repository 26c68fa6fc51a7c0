"""Rules for chunks: the number of actions that a query returns."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.determinism import not_repeatable
from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import LiberoMaxError, counted
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG


def _lengths(subject: PolicySubject) -> list[int]:
    return sorted({len(answer) for answer in subject.first.answers})


@rule("policy/chunk/length", "should", needs=ANSWERS)
def same_length(subject: PolicySubject) -> Finding:
    """Return the same number of actions from every query."""
    lengths = _lengths(subject)
    if len(lengths) == 1:
        return kept(f"every query returns {counted(lengths[0], 'action')}")
    return broken(
        f"answers of {', '.join(map(str, lengths))} actions",
        "the same number from every query",
        "The chunk drifts: a queue inside the adapter may hand out what is left of it.",
    )


@rule("policy/chunk/horizon", "should", needs=ANSWERS)
def horizon(subject: PolicySubject) -> Finding:
    """Return as many actions as the spec declares."""
    lengths, spec = _lengths(subject), subject.policy.spec
    if len(lengths) > 1:
        return unexamined("the number of actions changes from query to query")
    if lengths[0] == spec.horizon:
        return kept(f"every query returns H={spec.horizon}; Q={spec.query_interval}")
    return broken(
        f"every query returns {counted(lengths[0], 'action')}",
        f"horizon={spec.horizon}, as declared",
        "Declare the H that the model really returns.",
    )


@rule("policy/chunk/cut", "note", needs=ANSWERS)
def follows_horizon(subject: PolicySubject) -> Finding:
    """Cut the chunk where a smaller horizon is asked for."""
    spec = subject.policy.spec
    if spec.horizon == spec.query_interval:
        return kept("H and Q are equal: there is no smaller horizon")
    if isinstance(subject.once(_cut), LiberoMaxError):
        return broken(
            f"--libero-max-horizon={spec.query_interval} is not followed",
            "a chunk that is cut",
            "Return actions[: self.spec.horizon].",
        )
    return kept(f"--libero-max-horizon={spec.query_interval} is followed")


@rule("policy/chunk/first", "must", needs=ANSWERS)
def first_actions(subject: PolicySubject) -> Finding:
    """Return the first actions of the chunk where a smaller horizon is asked for."""
    spec = subject.policy.spec
    if spec.horizon == spec.query_interval:
        return kept("H and Q are equal: there is no smaller horizon")
    if reason := not_repeatable(subject):
        return reason
    subject.start()
    whole, part = subject.ask(0), subject.once(_cut)
    if isinstance(part, LiberoMaxError) or len(part) == len(whole):
        return unexamined("a smaller horizon is not followed")
    if part.tobytes() == whole[-len(part) :].tobytes() != whole[: len(part)].tobytes():
        return broken(
            "a smaller H gives the last actions of the chunk",
            "the first ones",
            "A deque with maxlen keeps its last entries: cut the chunk with [:n] before.",
        )
    if part.tobytes() == whole[: len(part)].tobytes():
        return kept("a smaller H gives the first actions of the chunk")
    return unexamined("a smaller H gives other actions: the model's own answer may depend on it")


def _cut(subject: PolicySubject) -> Actions | LiberoMaxError:
    """Return the answer to the first query of an episode with H = Q, or the error that it ends with."""
    policy, spec = subject.policy, subject.policy.spec
    try:
        policy.spec = replace(spec, horizon=spec.query_interval)
    except AttributeError:
        return LiberoMaxError("spec cannot be set")
    try:
        subject.start()
        with _silent_server():
            return subject.ask(0)
    except LiberoMaxError as error:
        return error
    finally:
        policy.spec = spec


@contextmanager
def _silent_server() -> Iterator[None]:
    """Silence the log of servers: a refusal that is provoked here is a finding."""
    SERVER_LOG.disabled = True
    try:
        yield
    finally:
        SERVER_LOG.disabled = False
