"""Rules of the contract itself: every query is answered, in time, and nothing is altered by it."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule
from pytest_libero_max.errors import counted
from pytest_libero_max.policies.model_inputs import marked_observation

LOADS = "policy/contract/loads"
ANSWERS = "policy/contract/answers"

SLOW_FIRST_S = 120.0
"""Longest first query that needs no attention, s: a model is compiled in it."""

SLOW_PAIR_S = 600.0
"""Longest time of a policy for a pair that needs no attention, s: 800 pairs then take five days."""


@rule(LOADS, "must")
def loads(subject: PolicySubject) -> Finding:
    """Load, and have every member of a policy."""
    spec = subject.policy.spec
    cameras = ", ".join(spec.cameras) or "no images"
    return kept(f"{spec.name} (H={spec.horizon} Q={spec.query_interval}): {cameras}")


@rule(ANSWERS, "must", needs=LOADS)
def answers(subject: PolicySubject) -> Finding:
    """Answer every query."""
    count = len(subject.first.answers)
    return kept(f"{counted(count, 'query', 'queries')} of an episode were answered")


@rule("policy/contract/observation", "must", needs=ANSWERS)
def observation_unchanged(subject: PolicySubject) -> Finding:
    """Leave the observation as it is."""
    subject.start()
    observation = marked_observation(subject.shown.observations[0])
    before = {key: value.copy() for key, value in observation.items()}
    subject.show(0, observation)
    written = [
        key
        for key, value in before.items()
        if key not in observation or not np.array_equal(value, observation[key])
    ]
    if not written:
        return kept("the observation stays as it is")
    return broken(
        f"{', '.join(written)} was written to",
        "an observation that stays as it is",
        "Give a copy to helpers that write into their argument, as robosuite's quat2axisangle does.",
    )


@rule("policy/contract/spec", "must", needs=ANSWERS)
def spec_unchanged(subject: PolicySubject) -> Finding:
    """Keep the spec as it was declared."""
    subject.start()
    subject.ask(0)
    before, after = subject.spec, subject.policy.spec
    if after == before:
        return kept("the spec stays as it was declared")
    changed = [name for name, value in vars(before).items() if getattr(after, name, None) != value]
    return broken(
        f"{', '.join(changed)} of the spec changed during an episode",
        "the spec that was declared",
        "The spec is part of every result: declare it when the policy is constructed.",
    )


@rule("policy/time/first", "note", needs=ANSWERS)
def first_query(subject: PolicySubject) -> Finding:
    """Answer the first query within two minutes."""
    seconds = subject.first.seconds[0]
    if seconds <= SLOW_FIRST_S:
        return kept(f"the first query takes {seconds:.3f} s")
    return broken(
        f"the first query takes {seconds:.0f} s",
        f"at most {SLOW_FIRST_S:.0f} s",
        "Load and compile the model when the policy is constructed.",
    )


@rule("policy/time/later", "note", needs=ANSWERS)
def later_queries(subject: PolicySubject) -> Finding:
    """Take ten minutes for a pair at most."""
    spec, episode = subject.policy.spec, subject.shown.episode
    later = float(np.median(subject.first.seconds[1:]))
    pair = 2 * episode.max_steps / spec.query_interval * later
    text = (
        f"later queries take {later:.3f} s: about {pair:.0f} s of policy for a pair of 2 x "
        f"{counted(episode.max_steps, 'step')}"
    )
    return judged(
        pair <= SLOW_PAIR_S,
        text,
        f"at most {SLOW_PAIR_S:.0f} s",
        "Serve it on a GPU, or play it on several machines.",
    )
