"""Rules for the beginning of episodes: the settled initial state by its index, and the same bits again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.contract import KEYS, SAME
from pytest_libero_max.conformance.environment.reference import RobotState
from pytest_libero_max.conformance.environment.subject import (
    EnvironmentSubject,
    Reading,
    copied,
    differing,
    hand_of,
    images_of,
    open_environment,
    starts,
)
from pytest_libero_max.conformance.fresh_process import result_elsewhere
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import counted
from pytest_libero_max.worlds.robot import CAMERAS

FIXTURES = "env/starts/fixtures"
INDEX = "env/starts/index"

_APART_LEVELS = 0.3
"""Mean difference of two images of the same state, of 255, that noise may make; a moved object makes more."""

_APART_M = 1e-3
"""Least difference between two initial states by which they are told apart."""

_INDEX_CURE = "Choose initial state `index` of the list; do not count resets, and draw nothing."


def _vector(robot: RobotState | Reading) -> NDArray[np.float64]:
    """Return (5,) position and fingers, m."""
    if isinstance(robot, RobotState):
        return np.array([*robot.position, *robot.gripper])
    return np.concatenate(hand_of(robot))


@rule("env/starts/settle", "must", needs=KEYS)
def settle(subject: EnvironmentSubject) -> Finding:
    """Play as many settle steps as declared before the first observation."""
    reading, declared = subject.start(), subject.declared.settle_steps
    possible = _settle_steps(subject, reading)
    if declared in possible:
        return kept(f"{declared} settle steps are played before the first observation")
    return broken(
        f"the first observation is that after {possible[0]} settle steps",
        f"after {declared}, as declared",
        "Objects of LIBERO begin above their support: play ten no-op steps, or declare settle_steps.",
    )


def _settle_steps(subject: EnvironmentSubject, reading: Reading) -> list[int]:
    """Return the numbers of settle steps that fit an observation, the likeliest first."""
    reference = subject.reference
    clock = subject.clock_s
    if clock is not None:
        steps = round(clock * reference.control_hz)
        if steps < len(reference.settling) and abs(clock * reference.control_hz - steps) < 1e-6:
            return [steps]
    apart = [float(np.abs(_vector(reading) - _vector(state)).max()) for state in reference.settling]
    return [steps for steps, value in enumerate(apart) if value <= min(apart) + 1e-6]


@rule("env/starts/state", "must", needs=KEYS)
def right_state(subject: EnvironmentSubject) -> Finding:
    """Begin from the initial state that the index names."""
    meant = [np.array(state.position) for state in subject.reference.starts]
    readings = subject.once(starts).settled
    for init, reading in readings.items():
        hand = hand_of(reading)[0]
        apart = [float(np.abs(position - hand).max()) for position in meant]
        nearest = int(np.argmin(apart))
        if nearest != init and apart[init] - apart[nearest] > _APART_M:
            return broken(
                f"initial state {init} has the hand of state {nearest}, {1000 * apart[init]:.1f} mm away",
                f"the hand of state {init} of {subject.reference.task}",
                _INDEX_CURE,
            )
        if apart[init] > 5 * _APART_M:
            return broken(
                f"in initial state {init} the hand is {1000 * apart[init]:.1f} mm away",
                f"the hand within {5000 * _APART_M:.0f} mm of that of LIBERO",
                "Set the initial state after the reset, of the right task.",
            )
    return kept(f"initial states {', '.join(map(str, sorted(readings)))} put the hand where LIBERO has it")


@rule(FIXTURES, "must", needs=KEYS)
def fixtures(subject: EnvironmentSubject) -> Finding:
    """Put the fixtures in the same place in every episode from the same initial state."""
    measured = subject.once(starts)
    first, second = measured.fixtures, measured.fixtures_later
    if first is None or second is None:
        return unexamined("no simulator of MuJoCo is found, whose bodies could be compared")
    apart_m = float(np.abs(first - second).max()) if first.shape == second.shape else float("inf")
    if apart_m == 0.0:
        return kept("every body stands where it stood in the first episode")
    return broken(
        f"after other episodes a fixture stands {1000 * apart_m:.1f} mm elsewhere",
        "the place of the first episode",
        "No initial state holds the places of fixtures: reset() draws them from numpy's global generator. "
        "Seed it before each reset.",
    )


@rule(INDEX, "must", needs=FIXTURES)
def by_index(subject: EnvironmentSubject) -> Finding:
    """Begin in the same state from the same index, whatever was played before."""
    if not subject.chooses:
        return unexamined("no initial state can be chosen", "Declare begin=, which takes the index.")
    init, measured = subject.reference.init, subject.once(starts)
    first, second = measured.settled[init], measured.returned
    apart_m = float(np.abs(hand_of(first)[0] - hand_of(second)[0]).max())
    levels = max((_levels(first[camera], second[camera]) for camera in images_of(first)), default=0.0)
    if apart_m < 0.1 * _APART_M and levels < _APART_LEVELS:
        return kept(f"initial state {init} begins the same after episodes from others")
    return broken(
        f"after episodes from others, initial state {init} has the hand {1000 * apart_m:.2f} mm elsewhere, "
        f"and images that differ by {levels:.2f} of 255 in the mean",
        "the same state",
        _INDEX_CURE,
    )


def _levels(first: NDArray[Any], second: NDArray[Any]) -> float:
    return float(np.abs(first.astype(float) - second.astype(float)).mean())


@rule("env/starts/count", "should", needs=KEYS)
def not_by_count(subject: EnvironmentSubject) -> Finding:
    """Begin in the same initial state after reset() with the same seed, however many resets came before."""
    environment = subject.environment
    if getattr(environment, "set_init_state", None) is not None or not hasattr(environment, "reset"):
        return unexamined("reset(seed=...) alone begins no episode")
    subject.abandon()
    hands = [hand_of(subject.restart(seed=0))[0] for _ in range(3)]
    subject.abandon()
    apart = max(float(np.abs(hand - hands[0]).max()) for hand in hands)
    if apart < _APART_M:
        return kept("reset(seed=0) begins in the same initial state each time")
    return broken(
        f"reset(seed=0) put the hand {1000 * apart:.1f} mm elsewhere the second or third time",
        "the same initial state for the same seed",
        "The count of resets chooses the initial state: two policies whose episodes end at other times are "
        "then compared on other states. Take the index as an argument.",
    )


_STEPS = 20
"""Steps of the recorded episode that are played again."""

_FRESH_S = 600.0
"""Longest time of the fresh process, s."""


@rule(SAME, "must", needs=INDEX)
def same_again(subject: EnvironmentSubject) -> Finding:
    """Arrive at the same observations from the same initial state with the same actions."""
    first, second = subject.once(_observations), _observations(subject)
    for step, (before, after) in enumerate(zip(first, second, strict=True)):
        parts = differing(before, after)
        if parts:
            return broken(
                f"the second time, the observation after {counted(step, 'step')} has another "
                f"{', '.join(parts)}",
                "the same observation",
                "Something outlives a reset: random numbers, a controller, fixtures that are placed anew.",
            )
    return kept(f"{counted(len(first) - 1, 'step')}, played twice, gave the same observations")


def _observations(subject: EnvironmentSubject) -> list[Reading]:
    readings = [copied(subject.begin(drawn=True))]
    for action in subject.reference.actions[:_STEPS]:
        readings.append(copied(subject.step(action).reading))
    return readings


def beginning(subject: EnvironmentSubject) -> dict[str, Any]:
    """Return what a process must find again: the state after each step, images as digests, fixtures."""
    steps = [
        {role: _plain(role, value) for role, value in reading.items()} for reading in _observations(subject)
    ]
    fixtures = subject.fixtures
    return {"steps": steps, "fixtures": None if fixtures is None else fixtures.tolist()}


def beginning_of(name: str) -> dict[str, Any]:
    """Return the beginning of the environment of a name."""
    return beginning(open_environment(name))


def _plain(role: str, value: Any) -> Any:
    if role in CAMERAS:
        return hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    return value if isinstance(value, str) else value.tolist()


@rule("env/repeats/process", "must", needs=SAME)
def fresh_process(subject: EnvironmentSubject) -> Finding:
    """Arrive at the same observations, with every fixture in the same place, in another process."""
    if not subject.name:
        return unexamined("the environment is an object of this process")
    subject.abandon()
    here = json.loads(json.dumps(beginning(subject)))
    there = result_elsewhere(
        beginning_of,
        subject.name,
        _FRESH_S,
        expected="the same episode",
        cure="The environment needs something of this process or its home.",
        environment={"HOME": str(Path.home())},  # LIBERO keeps its paths there
    )
    return there if isinstance(there, Finding) else _compared(here, there)


def _compared(here: dict[str, Any], there: dict[str, Any]) -> Finding:
    parts = []
    if here["fixtures"] != there["fixtures"]:
        apart_m = np.abs(np.subtract(here["fixtures"], there["fixtures"])).max()
        parts.append(f"a fixture stands {1000 * apart_m:.1f} mm elsewhere")
    for step, (first, second) in enumerate(zip(here["steps"], there["steps"], strict=True)):
        differ = [role for role in first if first[role] != second.get(role)]
        if differ:
            parts.append(f"after {counted(step, 'step')} {', '.join(differ)} differ")
            break
    if not parts:
        return kept("another process has the same observations after each step")
    return broken(
        f"in another process {' and '.join(parts)}",
        "the same episode, bit for bit",
        "Seed numpy's global generator before each reset; let no hash or clock decide what is built.",
    )
