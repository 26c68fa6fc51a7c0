"""Rules for actions, for a whole episode of them, and for the conventions of the state that they lead to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.contract import GRIPPER, KEYS, QUATERNION, RATE, RESTS
from pytest_libero_max.conformance.environment.reference import OPENING_STEPS, SIGNS
from pytest_libero_max.conformance.environment.subject import (
    EnvironmentSubject,
    Played,
    along_axes,
    hand_of,
    moved,
    settled,
)
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.policies.transforms.states import axis_angle, axis_angle_antipodal
from pytest_libero_max.worlds.robot import NOOP_ACTION

Array = NDArray[np.float64]

DIRECTIONS = "env/actions/directions"

_ALIKE = 0.9
"""Least cosine between two ways in the same direction."""

_TIMES = (0.8, 1.25)
"""Least and largest ratio of two ways of the same length."""

_DRIFT_M = 0.005
"""Largest way of the hand under no-op actions, m."""

_LEAST_TURN_RAD = 0.02


@rule(RESTS, "must", needs=RATE)
def rests(subject: EnvironmentSubject) -> Finding:
    """Hold the hand where it is under an action of zeros: actions are movements, not poses."""
    start = hand_of(subject.begin())[0]
    for _ in range(5):
        reading = subject.step(NOOP_ACTION).reading
    way_m = float(np.linalg.norm(hand_of(reading)[0] - start))
    if way_m <= _DRIFT_M:
        return kept(f"five no-op actions move the hand by {1000 * way_m:.1f} mm")
    return broken(
        f"five no-op actions move the hand by {1000 * way_m:.0f} mm",
        f"at most {1000 * _DRIFT_M:.0f} mm",
        "Actions are taken for absolute poses: set the controller's use_delta.",
    )


@rule(DIRECTIONS, "must", needs=RESTS)
def directions(subject: EnvironmentSubject) -> Finding:
    """Move the hand along the axis of the world that each of the first three components names."""
    names = "xyz"
    movements = subject.once(along_axes)
    for component, move in enumerate(subject.reference.moves[:3]):
        way = movements[component].way
        if _cosine(way, move.way) < _ALIKE:
            return broken(
                f"{counted(move.steps, 'action')} of +1 in {names[component]} move the hand by "
                f"{_millimetres(way)}",
                f"about {_millimetres(move.way)}",
                "The order, the sign or the frame of the action differs.",
            )
    return kept("the first three components move the hand along x, y and z of the world")


@rule("env/actions/scale", "must", needs=DIRECTIONS)
def scale(subject: EnvironmentSubject) -> Finding:
    """Move the hand as far as LIBERO does by an action of 1."""
    ratios = [
        float(np.linalg.norm(movement.way) / np.linalg.norm(move.way))
        for movement, move in zip(subject.once(along_axes), subject.reference.moves, strict=False)
    ]
    text = f"the hand moves {', '.join(f'{ratio:.2f}' for ratio in ratios)} times as far along x, y, z"
    return judged(
        all(_TIMES[0] <= ratio <= _TIMES[1] for ratio in ratios),
        text,
        f"between {_TIMES[0]:g} and {_TIMES[1]:g} times as far as LIBERO's",
        "The unit of an action is 5 cm at a step: look at the controller's output_max, and at its gains.",
    )


@rule("env/actions/rotation", "must", needs=QUATERNION)
def rotation(subject: EnvironmentSubject) -> Finding:
    """Turn the hand about the axis of the world that each of the components four to six names."""
    examined = 0
    for component, move in enumerate(subject.reference.moves[3:]):
        if np.linalg.norm(move.turn) < _LEAST_TURN_RAD:
            continue
        turn = moved(subject, move.action, move.steps).turn
        if turn is None:
            break
        examined += 1
        ratio = float(np.linalg.norm(turn) / np.linalg.norm(move.turn))
        if _cosine(turn, move.turn) < _ALIKE or not _TIMES[0] <= ratio <= _TIMES[1]:
            return broken(
                f"{counted(move.steps, 'action')} of +1 about {'xyz'[component]} turn the hand by "
                f"{_degrees(turn)}",
                f"about {_degrees(move.turn)}",
                "The order, sign, unit (0.5 rad) or frame differs: LIBERO turns about the world's axes.",
            )
    if examined:
        return kept("components four to six turn the hand about x, y and z of the world, as far as LIBERO's")
    return unexamined("the observation has no quaternion, or the reference's hand does not turn")


@rule(GRIPPER, "must", needs=RESTS)
def gripper(subject: EnvironmentSubject) -> Finding:
    """Close the gripper with +1, and open it with -1."""
    subject.begin()
    openings = []
    for sign in SIGNS:
        for _ in range(OPENING_STEPS):
            reading = subject.step((*NOOP_ACTION[:6], sign)).reading
        openings.append(float(np.abs(hand_of(reading)[1]).sum()))
    meant = subject.reference.openings
    text = f"openings after -1, +1, -1: {', '.join(f'{1000 * opening:.0f}' for opening in openings)} mm"
    return judged(
        np.abs(np.subtract(openings, meant)).max() < 0.01,
        text,
        f"about {', '.join(f'{1000 * opening:.0f}' for opening in meant)} mm",
        "+1 closes in LIBERO: the sign is the wrong way round, or the command is in [0, 1].",
    )


@rule("env/actions/range", "should", needs="env/actions/scale")
def range_of_actions(subject: EnvironmentSubject) -> Finding:
    """Cut movements beyond 1, as LIBERO's controller does, or refuse them."""
    move = subject.reference.moves[0]
    once = float(np.linalg.norm(subject.once(along_axes)[0].way))
    try:
        way, _ = moved(subject, [3.0 * move.action[0], *move.action[1:]], move.steps)
    except SubstrateError as error:
        subject.abandon()
        return kept(f"an action of 3 is refused: {error}")
    ratio = float(np.linalg.norm(way)) / once
    return judged(
        ratio <= _TIMES[1],
        f"an action of 3 moves the hand {ratio:.2f} times as far as one of 1",
        "as far as one of 1",
        "Clip actions to -1 to 1: a policy that overshoots otherwise moves differently than in LIBERO.",
    )


def _cosine(a: Sequence[float] | Array, b: Sequence[float] | Array) -> float:
    return float(np.dot(a, b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12))


def _millimetres(way: Sequence[float] | Array) -> str:
    return f"({', '.join(f'{1000 * value:+.0f}' for value in way)}) mm"


def _degrees(turn: Sequence[float] | Array) -> str:
    return f"({', '.join(f'{np.degrees(value):+.0f}' for value in turn)}) degrees"


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


_CLOSE = 0.03
"""Largest difference of components of a quaternion."""

_FINGERS_M = 0.003
"""Largest difference of a finger's position, m."""

_CLOSE_RAD = 0.1
"""Largest difference of components of axis times angle, rad."""


@rule(QUATERNION, "must", needs=RESTS)
def quaternion(subject: EnvironmentSubject) -> Finding:
    """Give the hand's orientation as LIBERO does: x, y, z, w of the hand in the world."""
    value = subject.once(settled).get("quaternion")
    if value is None:
        return unexamined("the observation has no quaternion")
    reference = subject.reference
    meant = np.array(reference.settling[reference.settle_steps].quaternion)
    kinds = {
        "x, y, z, w": meant,
        "x, y, z, w with the other sign": -meant,
        "w, x, y, z": np.roll(meant, 1),
        "the inverse rotation": meant * (-1, -1, -1, 1),
    }
    apart = {kind: float(np.abs(value - each).max()) for kind, each in kinds.items()}
    best = min(apart, key=lambda kind: apart[kind])
    if apart["x, y, z, w"] < _CLOSE:
        return kept(f"x, y, z, w, within {apart['x, y, z, w']:.1g}")
    observed = best if apart[best] < _CLOSE else "another rotation"
    return broken(
        f"{observed}: ({', '.join(f'{each:.3f}' for each in value)})",
        f"about ({', '.join(f'{each:.3f}' for each in meant)})",
        "Return robosuite's robot0_eef_quat as it is.",
    )


@rule("env/states/fingers", "must", needs=GRIPPER)
def fingers(subject: EnvironmentSubject) -> Finding:
    """Give the positions of both finger joints, m, the second one below zero."""
    reading, reference = subject.once(settled), subject.reference
    value = reading["gripper"] if "gripper" in reading else reading["state"][6:]
    meant = np.array(reference.settling[reference.settle_steps].gripper)
    text = f"({', '.join(f'{each:.4f}' for each in value)})"
    if float(np.abs(value - meant).max()) < _FINGERS_M:
        return kept(f"{text} m")
    return broken(
        text,
        f"about ({', '.join(f'{each:.4f}' for each in meant)}) m",
        "Return robosuite's robot0_gripper_qpos as it is: not a width, not one sign for both.",
    )


@rule("env/states/vector", "should", needs=FOLLOWS)
def vector(subject: EnvironmentSubject) -> Finding:
    """Give the state vector as position, axis times angle, fingers, with the angle up to two pi."""
    played = subject.once(episode)
    states = [step.reading["state"] for step in played.steps if "state" in step.reading]
    if not states:
        return unexamined("the observation has no state vector of eight")
    references = subject.reference.steps[: len(states)]
    rules = {
        "axis times angle with the quaternion's sign": axis_angle,
        "axis times angle of at most pi (antipodal)": axis_angle_antipodal,
    }
    wrong = {
        kind: sum(
            float(np.abs(state[3:6] - convert(np.array(meant.quaternion))).max()) > _CLOSE_RAD
            for state, meant in zip(states, references, strict=True)
        )
        for kind, convert in rules.items()
    }
    libero, antipodal = wrong
    if not wrong[libero]:
        return kept(f"{libero}, in all of {counted(len(states), 'step')}")
    observed = antipodal if not wrong[antipodal] else "another rotation"
    return broken(
        f"{observed}: {wrong[libero]} of {counted(len(states), 'step')} differ from LIBERO's",
        f"{libero}, as robosuite's quat2axisangle",
        "A model was trained on one of the two, and fails on the other: let users choose, and say which.",
    )
