"""Rules for the robot's state: conventions of rotations and of the fingers."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.conformance.environment.contract import GRIPPER, QUATERNION, RESTS
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject, settled
from pytest_libero_max.conformance.environment.task import FOLLOWS, episode
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import counted
from pytest_libero_max.policies.transforms.states import axis_angle, axis_angle_antipodal

_CLOSE = 0.03
"""Largest difference of components of a quaternion."""

_CLOSE_M = 0.003
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
    if float(np.abs(value - meant).max()) < _CLOSE_M:
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
