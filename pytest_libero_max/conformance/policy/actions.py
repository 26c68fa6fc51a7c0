"""Rules for answers: units, size, the gripper, and the number of actions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.determinism import not_repeatable
from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import LiberoMaxError, counted
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG

FAR_BEYOND = 3.0
"""Components larger than this are in other units, not movements that overshoot [-1, 1]."""

LEAST_MOVEMENT = 0.06
"""Movements that are all below it, 3 mm a step, reach nothing within an episode; 0.05 is 5 cm in metres."""

LEAST_ROTATION = 0.01
"""A rotation that is below it throughout, 0.3 degrees a step, turns nothing within an episode."""

MOST_CLIPPED = 0.05
"""Largest share of components beyond [-1, 1], which the controller clips."""

FAR_AWAY_M = 0.5
"""Largest plausible distance of the next target: a hand moves 5 cm in a step."""


def _sizes(subject: PolicySubject) -> tuple[float, float, str]:
    """Largest movement and rotation, each by its own size (the gripper would hide both), and their text."""
    actions = subject.actions
    parts = (slice(0, 3), slice(3, -1))
    movement, rotation = (float(np.abs(actions[:, part]).max(initial=0.0)) for part in parts)
    return movement, rotation, f"movement up to {movement:.3g}, rotation up to {rotation:.3g}"


def _moves(subject: PolicySubject) -> bool:
    """Return True if actions are movements, in units that can be judged."""
    return subject.policy.spec.control == "delta" and max(_sizes(subject)[:2]) <= FAR_BEYOND


_OTHER = unexamined("actions are poses, or movements in other units")


@rule("policy/actions/units", "must", needs=ANSWERS)
def units(subject: PolicySubject) -> Finding:
    """Return movements within [-1, 1], or poses that begin near the hand."""
    if subject.policy.spec.control == "absolute":
        return _poses(subject)
    movement, rotation, sizes = _sizes(subject)
    return judged(
        max(movement, rotation) <= FAR_BEYOND,
        sizes,
        "movements within [-1, 1]",
        "These are other units: un-normalise the actions, or do not un-normalise them twice. Poses are "
        'declared with PolicySpec(control="absolute").',
    )


def _poses(subject: PolicySubject) -> Finding:
    """Judge the distance to which the first action of each answer sends the hand."""
    first = np.array([answer[0] for answer in subject.first.answers])
    hands = [observation["robot0_eef_pos"] for observation in subject.shown.observations]
    farthest = float(np.linalg.norm(first[:, :3] - hands, axis=1).max())
    if farthest <= FAR_AWAY_M:
        return kept(f"poses; the first of an answer is up to {farthest:.2g} m from the hand")
    return broken(
        f"the first pose of an answer is up to {farthest:.2g} m from the hand",
        "poses in the world that begin near the hand",
        "These are movements, of another frame, or normalised still.",
    )


@rule("policy/actions/moves", "should", needs=ANSWERS)
def moves(subject: PolicySubject) -> Finding:
    """Move the hand."""
    if subject.policy.spec.control == "absolute" or subject.actions[:, :-1].any():
        return kept("the hand is moved")
    return broken("no movement at all", "movements", "A policy that holds still, or one that got zeros.")


@rule("policy/actions/large", "should", needs=ANSWERS)
def large(subject: PolicySubject) -> Finding:
    """Return movements that reach something within an episode."""
    movement, _, sizes = _sizes(subject)
    if not _moves(subject):
        return _OTHER
    if movement >= LEAST_MOVEMENT or not subject.actions[:, :-1].any():
        return kept(f"movement up to {movement:.3g}")
    return broken(
        sizes,
        f"movements of at least {LEAST_MOVEMENT}, 3 mm a step",
        "Too small to reach anything: metres instead of LIBERO's units (1 is 5 cm), or normalised still.",
    )


@rule("policy/actions/clipped", "should", needs=ANSWERS)
def clipped(subject: PolicySubject) -> Finding:
    """Return few components beyond 1, which the controller clips."""
    if not _moves(subject):
        return _OTHER
    share = float((np.abs(subject.actions[:, :-1]) > 1.0).mean())
    if share <= MOST_CLIPPED:
        return kept(f"{share:.0%} of movements and rotations are clipped")
    return broken(
        f"{share:.0%} of the components are beyond 1 and will be clipped",
        "few",
        "Look at the un-normalisation.",
    )


@rule("policy/actions/rotation", "note", needs=ANSWERS)
def rotation(subject: PolicySubject) -> Finding:
    """Return rotations that turn the hand within an episode, or none."""
    movement, rotation, sizes = _sizes(subject)
    if not _moves(subject):
        return _OTHER
    if rotation == 0.0 or rotation >= LEAST_ROTATION or movement < LEAST_MOVEMENT:
        return kept(f"rotation up to {rotation:.3g}")
    return broken(
        sizes,
        f"rotations of at least {LEAST_ROTATION}, or none",
        "Hardly any: right for a policy that never turns the hand, else normalised still (1 is 0.5 rad).",
    )


@rule("policy/gripper/units", "must", needs=ANSWERS)
def gripper_units(subject: PolicySubject) -> Finding:
    """Open the gripper with -1, close it with +1."""
    # The signs of a robot that opens with +1 are turned round first.
    values = subject.actions[:, -1] * -subject.robot.opening
    low, high = float(values.min()), float(values.max())
    if max(-low, high) > FAR_BEYOND:
        return broken(
            f"from {low:.3g} to {high:.3g}",
            "-1 opens, +1 closes",
            "These are other units: the sign of a centred value is enough.",
        )
    if low >= 0.0 and high <= 1.0 and len(set(np.round(values, 6))) <= 2 and low == 0.0:
        return broken(
            "0 or 1", "-1 opens, +1 closes", "It is a flag: write 1 - 2 * (g > 0.5) where 1 means open."
        )
    if low >= 0.0 and high <= 1.0 and low < 1.0:
        return broken(
            f"from {low:.2g} to {high:.2g}",
            "-1 opens, +1 closes",
            "It is a probability or an opening from 0 to 1: write -sign(2 g - 1) where 1 means open.",
        )
    return kept(f"the gripper is asked for {low:.3g} to {high:.3g}")


@rule("policy/gripper/opens", "should", needs=ANSWERS)
def gripper_open(subject: PolicySubject) -> Finding:
    """Keep the gripper open at the beginning of an episode: with -1, on LIBERO."""
    sign = -subject.robot.opening
    executed, values = subject.executed[:, -1] * sign, subject.actions[:, -1] * sign
    flag = values.min() >= 0.0 and values.max() <= 1.0 and values.min() < 1.0
    if flag or np.abs(values).max() > FAR_BEYOND:
        return unexamined("the gripper is in other units")
    if (executed > 0.0).mean() <= 0.9:
        return kept("open at the beginning of the episode, as far as it was asked")
    return broken(
        "closes at once, far from any object",
        "open (-1) at the beginning of an episode",
        "The sign may be the wrong way round: LIBERO's gripper closes at +1.",
    )


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
