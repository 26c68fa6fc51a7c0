"""Rules for actions: what each component does, how far, and which way the gripper goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.contract import GRIPPER, QUATERNION, RATE, RESTS
from pytest_libero_max.conformance.environment.reference import OPENING_STEPS, SIGNS
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject, along_axes, hand_of, moved
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import SubstrateError, counted
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
