"""Rules for the task: a recorded episode goes the same way and is solved in the same step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pytest_libero_max.conformance.environment.actions import DIRECTIONS
from pytest_libero_max.conformance.environment.contract import KEYS
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject, Played, hand_of, settled
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import counted

FOLLOWS = "env/task/follows"

_CLOSE_M = 0.005
"""Largest distance of the hand from the recorded one, m."""

_EXACT_M = 1e-4
"""Distance of the hand from the recorded one up to which objects move as recorded too, m."""

_LATER = 5
"""Steps around the recorded success in which the environment may find it where the hand is not exact."""


@dataclass
class Episode:
    """The recorded episode as the environment plays it."""

    steps: list[Played] = field(default_factory=list)
    """Until the recorded success, or until it ended."""
    apart_m: list[float] = field(default_factory=list)
    """Distance of the hand from the recorded one after each step, m."""
    success_step: int | None = None
    """Step after which it said that the task is solved; None for never, within a few steps more."""


def episode(subject: EnvironmentSubject) -> Episode:
    """Play the recorded episode, and a few steps that repeat its last action."""
    reference, result = subject.reference, Episode()
    subject.begin()
    for number in range(1, reference.success_step + _LATER + 1):
        index = min(number, reference.success_step) - 1
        played = subject.step(reference.actions[index])
        if number <= reference.success_step:
            result.steps.append(played)
            apart = hand_of(played.reading)[0] - np.array(reference.steps[index].position)
            result.apart_m.append(float(np.linalg.norm(apart)))
        if played.success:
            result.success_step = number
        if played.success or played.done:
            break
    return result


@rule("env/task/instruction", "should", needs=KEYS)
def instruction(subject: EnvironmentSubject) -> Finding:
    """Give the instruction that LIBERO's benchmark gives, which is that of the task's name."""
    value = subject.once(settled).get("instruction") or subject.attribute(
        "task_description", "language_instruction", "instruction"
    )
    meant = subject.reference.instruction
    if not isinstance(value, str):
        return unexamined("neither the observation nor the environment has an instruction")
    return judged(
        value.strip().lower() == meant.lower(),
        repr(value),
        repr(meant),
        "Take task.language of the benchmark: the BDDL file has another sentence, and the name of a "
        "variation has more in it.",
    )


@rule(FOLLOWS, "should", needs=DIRECTIONS)
def follows(subject: EnvironmentSubject) -> Finding:
    """Take the hand along the recorded way under the recorded actions."""
    played = subject.once(episode)
    steps, total = len(played.steps), subject.reference.success_step
    worst = int(np.argmax(played.apart_m))
    text = f"the hand is at most {1000 * played.apart_m[worst]:.2f} mm from the recorded one in {steps} steps"
    if played.apart_m[worst] <= _CLOSE_M and (steps == total or played.success_step):
        return kept(text)
    first = next((step for step, apart in enumerate(played.apart_m) if apart > _CLOSE_M), worst)
    return broken(
        f"{text}, and more than {1000 * _CLOSE_M:.0f} mm from step {first + 1} on"
        if played.apart_m[worst] > _CLOSE_M
        else f"the episode ended after {steps} of {counted(total, 'step')}",
        f"at most {1000 * _CLOSE_M:.0f} mm",
        "The controller, its gains, the scene or the simulator differs: compare the versions.",
    )


@rule("env/task/success", "must", needs=FOLLOWS)
def success(subject: EnvironmentSubject) -> Finding:
    """Report success in the step in which LIBERO's predicates first hold, and not before."""
    played = subject.once(episode)
    observed, meant = played.success_step, subject.reference.success_step
    allowed = 1 if max(played.apart_m) <= _EXACT_M else _LATER
    if observed is not None and abs(observed - meant) <= allowed:
        return kept(f"success is reported after step {observed} of the recorded episode")
    return broken(
        "success is not reported"
        if observed is None
        else f"success is reported after step {observed}, {counted(abs(observed - meant), 'step')} "
        f"{'early' if observed < meant else 'late'}",
        f"success after step {meant}, give or take {counted(allowed, 'step')}",
        "Ask check_success() after each step, and return it as info['is_success'] or as done.",
    )
