"""Motion of the hand: the length of its way, and its jerk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_libero_max.pairing.probes.probe import Column, Probe, View
from pytest_libero_max.worlds.contract import Array


class Motion(Probe[tuple[float, ...]]):
    """Way and jerk of the hand, by step.

    The jerk is the third difference of the hand's position times the cube of the control rate (20 Hz). It is
    that of the sampled positions: what happens between two policy steps is not in it.
    """

    name = "motion"
    schema = (
        Column("path_m", "float", "Length of the way of the hand", "m", least=0),
        Column("jerk_m_s3", "float", "Root mean square of its jerk", "m/s^3", optional=True, least=0),
        Column("step_m", "float", "Way in each step", "m", many=True, least=0),
        Column(
            "step_jerk_m_s3",
            "float",
            "Jerk over the last three steps, from the third step on",
            "m/s^3",
            many=True,
            least=0,
        ),
    )
    cost = "nothing a step, 6 kB an arm of 300 steps in the record"
    every = "end"

    def start(self, view: View) -> tuple[float, ...]:
        """Return where the hand is, (3,) m."""
        return tuple(map(float, view.world.end_effector()))

    def columns(self, state: tuple[float, ...], view: View) -> Mapping[str, Any]:
        """Return the sums, and the values of each step to a tenth of a millimetre."""
        hand = np.array([state, *(step.end_effector for step in view.trajectory.executed)])
        ways, jerks = ways_m(hand), jerks_m_s3(hand, view.world.robot.control_hz)
        return {
            "path_m": round(float(ways.sum()), 4),
            "jerk_m_s3": round(float(np.sqrt((jerks**2).mean())), 4) if len(jerks) else None,
            "step_m": ways.round(4).tolist(),
            "step_jerk_m_s3": jerks.round(2).tolist(),
        }


def ways_m(hand: Array) -> Array:
    """Return the (n,) way in each step of a hand that was at these (n + 1, 3) m."""
    return np.asarray(np.linalg.norm(np.diff(hand, axis=0), axis=1))


def jerks_m_s3(hand: Array, hz: int) -> Array:
    """Return the (n - 2,) jerk over each three steps of a hand that was at these (n + 1, 3) m."""
    return np.asarray(np.linalg.norm(np.diff(hand, n=3, axis=0), axis=1)) * hz**3
